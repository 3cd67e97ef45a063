#include "hamelin/scene/distance.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "box_tree.hpp"
#include "hamelin/core/isa_kernels.hpp"
#include "hamelin/core/numbers.hpp"
#include "kernel/segment_box.hpp"

namespace hamelin::scene {

namespace kernel {
HAMELIN_SELECT_KERNELS(TreeKernels, tree_kernels)
}  // namespace kernel

namespace {

using box_tree::float_infinity;
using box_tree::width;

std::uint64_t next_revision() noexcept {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

}  // namespace

// docs/theory.md (11.1)–(11.3)
BoxHit closest_on_box(const Eigen::Vector3d& p, const Box& box) {
  BoxHit hit;
  hit.point = p.cwiseMax(box.lo).cwiseMin(box.hi);
  const Eigen::Vector3d out = p - hit.point;
  const double d2 = out.squaredNorm();
  // Below 1e-150 the square has lost its digits; such a point lies on the surface.
  if (d2 > 1e-300) {
    hit.distance = std::sqrt(d2);
    hit.direction = out / hit.distance;
    return hit;
  }
  int axis = 0;
  const double below = (p - box.lo).minCoeff(&axis);
  int axis_above = 0;
  const double above = (box.hi - p).minCoeff(&axis_above);
  const bool up = above < below;
  if (up) axis = axis_above;
  hit.distance = -std::max(0.0, std::min(below, above));
  hit.direction[axis] = up ? 1.0 : -1.0;
  hit.point[axis] = up ? box.hi[axis] : box.lo[axis];
  return hit;
}

SegmentHit closest_on_box(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Box& box) {
  const kernel::Axis axis = kernel::axis_of(a.data(), b.data());
  SegmentHit hit;
  hit.along = kernel::nearest_along(axis, box.lo.data(), box.hi.data());
  hit.axis_point = a + hit.along * (b - a);
  // an axis nearer than this enters the box, except for rounding
  constexpr double entered = 1e-12;
  if (kernel::squared_distance(axis, box.lo.data(), box.hi.data(), hit.along) <=
      entered * entered) {
    // docs/theory.md (11.11): the depth is the least of six linear functions; it is greatest where
    // two of them cross, or at an end.
    const auto depth_at = [&](double t) {
      const Eigen::Vector3d p = a + t * (b - a);
      return (p - box.lo).cwiseMin(box.hi - p).minCoeff();
    };
    double deepest = depth_at(hit.along);
    const auto consider = [&](double t) {
      if (!(t >= 0.0 && t <= 1.0) || !(depth_at(t) > deepest)) return;
      deepest = depth_at(t);
      hit.along = t;
    };
    consider(0.0);
    consider(1.0);
    const auto face = [&](int i) {  // α and β: value at a and slope
      return std::array<double, 2>{i < 3 ? a[i] - box.lo[i] : box.hi[i - 3] - a[i - 3],
                                   i < 3 ? b[i] - a[i] : a[i - 3] - b[i - 3]};
    };
    for (int i = 0; i < 6; ++i)
      for (int j = i + 1; j < 6; ++j)
        if (face(i)[1] != face(j)[1])
          consider((face(j)[0] - face(i)[0]) / (face(i)[1] - face(j)[1]));
    hit.axis_point = a + hit.along * (b - a);
  }
  static_cast<BoxHit&>(hit) = closest_on_box(hit.axis_point, box);
  return hit;
}

BoxField::BoxField(std::vector<Box> boxes, const Eigen::Vector3d& origin)
    : boxes_(std::move(boxes)), origin_(origin) {
  if (!boxes_.empty()) build_all();
}

void BoxField::build_all() {
  revision_ = next_revision();
  kernels_ = &kernel::select_tree_kernels(default_isa());
  nodes_.clear();
  first_added_ = 0;
  box_tree::append(boxes_, 0, origin_, nodes_, slot_of_);
  nodes_.shrink_to_fit();
  first_added_ = boxes_.size();
  first_added_node_ = nodes_.size();
}

void BoxField::change(std::span<const std::int32_t> removed, std::span<const Box> added) {
  const Box nowhere{Eigen::Vector3d::Constant(infinity), Eigen::Vector3d::Constant(infinity)};
  // With more added boxes than this, and a quarter of the first ones, the tree is built again.
  constexpr std::size_t few = 1024;
  for (const std::int32_t box : removed) {
    boxes_[static_cast<std::size_t>(box)] = nowhere;
    if (static_cast<std::size_t>(box) >= first_added_) continue;  // its tree is replaced below
    const std::int32_t place = slot_of_[static_cast<std::size_t>(box)];
    kernel::TreeNode& node = nodes_[static_cast<std::size_t>(place) / width];
    for (std::size_t axis = 0; axis < 3; ++axis)
      node.lo[axis][static_cast<std::size_t>(place) % width] =
          node.hi[axis][static_cast<std::size_t>(place) % width] = float_infinity;
  }
  revision_ = next_revision();
  if (first_added_ == 0 || added.size() > few + first_added_ / 4) return rebuild(added);
  // The first tree's root moves behind its nodes, to make room for a root above both trees.
  if (nodes_.size() == first_added_node_) {
    nodes_.push_back(nodes_.front());
    for (std::size_t slot = 0; slot < static_cast<std::size_t>(nodes_.back().count); ++slot)
      if (const std::int32_t child = nodes_.back().child[slot]; child < 0)
        slot_of_[static_cast<std::size_t>(-1 - child)] =
            static_cast<std::int32_t>(first_added_node_ * width + slot);
  }
  nodes_.resize(first_added_node_ + 1);
  boxes_.resize(first_added_);
  slot_of_.resize(first_added_);
  kernel::TreeNode root = box_tree::empty_root();
  box_tree::attach(root, nodes_[first_added_node_], first_added_node_);
  if (!added.empty()) {
    std::vector<Box> own(added.begin(), added.end());
    const std::size_t at = nodes_.size();
    box_tree::append(own, first_added_, origin_, nodes_, slot_of_);
    boxes_.insert(boxes_.end(), own.begin(), own.end());
    box_tree::attach(root, nodes_[at], at);
  }
  nodes_.front() = root;
}

void BoxField::rebuild(std::span<const Box> added) {
  boxes_.resize(first_added_);
  boxes_.erase(std::remove_if(boxes_.begin(), boxes_.end(),
                              [](const Box& box) { return !(box.lo.x() < infinity); }),
               boxes_.end());
  boxes_.insert(boxes_.end(), added.begin(), added.end());
  nodes_.clear();
  slot_of_.clear();
  first_added_ = first_added_node_ = 0;
  if (!boxes_.empty()) build_all();
}

void BoxField::overlapping(const Box& box, std::vector<std::int32_t>& out) const {
  out.clear();
  if (boxes_.empty()) return;
  std::array<float, 3> lo{}, hi{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    lo[axis] = box_tree::round_down(box.lo[a] - origin_[a]);
    hi[axis] = box_tree::round_up(box.hi[a] - origin_[a]);
  }
  std::vector<std::int32_t> waiting{0};
  while (!waiting.empty()) {
    const kernel::TreeNode& node = nodes_[static_cast<std::size_t>(waiting.back())];
    waiting.pop_back();
    for (std::size_t slot = 0; slot < static_cast<std::size_t>(node.count); ++slot) {
      bool apart = false;
      for (std::size_t axis = 0; axis < 3; ++axis)
        apart = apart || node.lo[axis][slot] > hi[axis] || node.hi[axis][slot] < lo[axis];
      if (apart) continue;
      if (node.child[slot] >= 0) {
        waiting.push_back(node.child[slot]);
        continue;
      }
      const Box& other = boxes_[static_cast<std::size_t>(-1 - node.child[slot])];
      if ((other.lo.array() < box.hi.array()).all() && (box.lo.array() < other.hi.array()).all())
        out.push_back(-1 - node.child[slot]);
    }
  }
  std::sort(out.begin(), out.end());
}

kernel::Tree BoxField::tree() const noexcept {
  static_assert(sizeof(Box) == 6 * sizeof(double));
  return {nodes_.data(), boxes_.front().lo.data(), {origin_[0], origin_[1], origin_[2]}};
}

namespace {

// A point or an axis: the arguments of the kernels (see TreeKernels) and the exact result for a box
// that they found.
struct Point {
  const Eigen::Vector3d &a, &b;  ///< the same point
  [[nodiscard]] const double* first() const { return a.data(); }
  [[nodiscard]] const double* second() const { return nullptr; }
  [[nodiscard]] BoxHit on(const Box& box) const { return closest_on_box(a, box); }
};
struct Axis {
  const Eigen::Vector3d &a, &b;
  [[nodiscard]] const double* first() const { return a.data(); }
  [[nodiscard]] const double* second() const { return b.data(); }
  [[nodiscard]] SegmentHit on(const Box& box) const { return closest_on_box(a, b, box); }
};

template <class From, class Hit>
void evaluate(const From& from, const std::vector<Box>& boxes, std::int32_t box, Hit& hit) {
  hit = from.on(boxes[static_cast<std::size_t>(box)]);
  hit.box = box;
}

template <class From, class Hit>
bool nearest_of(const From& from, const kernel::TreeKernels& kernels, const kernel::Tree& tree,
                const std::vector<Box>& boxes, double limit, std::int32_t hint, Hit& hit) {
  kernel::Found found{0.0, hint};
  if (!kernels.nearest(tree, from.first(), from.second(), limit, found)) return false;
  evaluate(from, boxes, found.box, hit);
  return true;
}

}  // namespace

bool BoxField::nearest(const Eigen::Vector3d& p, double limit, BoxHit& hit,
                       std::int32_t hint) const {
  if (boxes_.empty() || !(limit >= 0.0)) return false;
  return nearest_of(Point{p, p}, *kernels_, tree(), boxes_, limit, valid_hint(hint), hit);
}

bool BoxField::nearest(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit,
                       SegmentHit& hit, std::int32_t hint) const {
  if (boxes_.empty() || !(limit >= 0.0)) return false;
  return nearest_of(Axis{a, b}, *kernels_, tree(), boxes_, limit, valid_hint(hint), hit);
}

bool BoxField::Vicinity::covers(const BoxField& field, const Eigen::Vector3d& a,
                                const Eigen::Vector3d& b, double limit) const noexcept {
  constexpr double rounding = 1e-9;  // far above that of points and distances [m]
  const double rest = reach_ - rounding - limit;
  return revision_ == field.revision_ && rest >= 0.0 && (a - a_).squaredNorm() <= rest * rest &&
         (b - b_).squaredNorm() <= rest * rest;
}

void BoxField::Vicinity::gather(const BoxField& field, const Eigen::Vector3d& a,
                                const Eigen::Vector3d& b, double reach) noexcept {
  revision_ = field.revision_;
  a_ = a;
  b_ = b;
  reach_ = reach;
  node_count_ = field.kernels_->gather(field.tree(), a.data(), a == b ? nullptr : b.data(), reach_,
                                       nodes_.get(), static_cast<int>(nodes_max));
}

template <class From, class Hit>
std::size_t BoxField::nearest_distinct_of(const From& from, double limit, double cone_cosine,
                                          Scratch& scratch, std::span<Hit> out,
                                          Vicinity* vicinity) const {
  if (boxes_.empty() || !(limit >= 0.0)) return 0;
  std::array<kernel::Found, distinct_max> found;
  const int most = static_cast<int>(std::min(out.size(), distinct_max));
  const bool moves = vicinity != nullptr;
  Vicinity& near = moves ? *vicinity : scratch.once_;
  if (!moves || !near.covers(*this, from.a, from.b, limit))
    near.gather(*this, from.a, from.b, limit + (moves ? near.skin_m_ : 0.0));
  int count = 0;
  if (near.node_count_ >= 0) {
    std::array<float, Vicinity::nodes_max * width> bounds;
    count = kernels_->nearest_distinct_among(tree(), near.nodes_.get(), near.node_count_,
                                             from.first(), from.second(), limit, cone_cosine,
                                             bounds.data(), found.data(), most);
  } else {
    scratch.fit(*this);
    count = kernels_->nearest_distinct(tree(), from.first(), from.second(), limit, cone_cosine,
                                       scratch.queue_.data(), found.data(), most);
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i)
    evaluate(from, boxes_, found[i].box, out[i]);
  return static_cast<std::size_t>(count);
}

std::size_t BoxField::nearest_distinct(const Eigen::Vector3d& p, double limit, double cone_cosine,
                                       Scratch& scratch, std::span<BoxHit> out,
                                       Vicinity* vicinity) const {
  return nearest_distinct_of(Point{p, p}, limit, cone_cosine, scratch, out, vicinity);
}

std::size_t BoxField::nearest_distinct(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                       double limit, double cone_cosine, Scratch& scratch,
                                       std::span<SegmentHit> out, Vicinity* vicinity) const {
  return nearest_distinct_of(Axis{a, b}, limit, cone_cosine, scratch, out, vicinity);
}

}  // namespace hamelin::scene
