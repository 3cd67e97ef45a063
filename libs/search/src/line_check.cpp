#include "hamelin/search/line_check.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "hamelin/core/isa_kernels.hpp"
#include "hamelin/search/edge_check.hpp"
#include "kernel/line_lanes.hpp"
#include "lane_chain.hpp"
#include "line_arm.hpp"

namespace hamelin::search {

namespace kernel {
HAMELIN_SELECT_KERNELS(LineKernels, line_kernels)
}  // namespace kernel

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double block_length = 0.7;  // of a motion per 16 pieces at first [rad or m]
constexpr int blocks_max = 64;
constexpr int divisions = 2;                // by four, before the exact check
constexpr double constant_margin_m = 2e-4;  // variation that is neglected by exact checks
constexpr double shortest_piece = 0.01;     // that exact checks divide [rad or m]
constexpr double inflation = 1.0 + 1e-5;    // of bounds, above what rounding to float can take
constexpr std::size_t open_reserve = 4096;

float inflated(double x) {
  return static_cast<float>(x * inflation);
}

kernel::Primitive primitive_of(const scene::Obstacle& obstacle, const geometry::SE3& pose,
                               double nearer_m, double extent_m, double position_rounding_m) {
  kernel::Primitive out{};
  Vector3d half = Vector3d::Zero();
  double radius = 0.0;
  switch (obstacle.shape) {
    case scene::Shape::box:
      half = 0.5 * obstacle.size_m;
      break;
    case scene::Shape::cylinder:
      half = {obstacle.radius_m, 0.0, 0.5 * obstacle.length_m};
      out.cylinder = true;
      break;
    case scene::Shape::capsule:
      half.z() = 0.5 * obstacle.length_m;
      radius = obstacle.radius_m;
      break;
    default:
      radius = obstacle.radius_m;
  }
  radius += nearer_m;
  for (Index i = 0; i < 3; ++i) {
    out.center[i] = static_cast<float>(pose.p()[i]);
    out.half[i] = static_cast<float>(half[i]);
    for (Index k = 0; k < 3; ++k) out.axes[k][i] = static_cast<float>(pose.R()(i, k));
  }
  out.radius = static_cast<float>(radius);
  out.ball = inflated(half.norm() + radius);
  // docs/theory.md (17.16)
  constexpr double roundings = 32.0;
  out.slack =
      inflated(position_rounding_m + roundings * LineArm::unit_roundoff *
                                         (extent_m + pose.p().norm() + half.norm() + radius));
  return out;
}

}  // namespace

class LineCheck::Impl {
 public:
  Impl(const model::Model& model, const scene::SelfField* self)
      : model_(model),
        arm_(model, self),
        edge_(model, self),
        kernels_(kernel::select_line_kernels(default_isa())),
        scratch_(std::make_unique<kernel::Scratch>()),
        line_(std::make_unique<kernel::Line>()),
        hints_(model.shapes().size(), {-1, -1}) {
    open_.reserve(open_reserve);
    subjects_.reserve(model.shapes().size() + (self != nullptr ? self->pairs().size() : 0));
    places_.reserve(kernel::places_max);
    for (auto* x : {&dq_, &curvature_, &part_kappa_, &pair_way_, &qa_, &qb_, &abs_dq_})
      x->setZero(model.dof());
    part_kappa_.setZero(arm_.part_levers().rows());
    pair_way_.setZero(arm_.levers().pairs().rows());
    primitives_.reserve(kernel::primitives_max);
    for (kernel::Hot& hot : scratch_->hot) hot = {-1, -1};
    scratch_->exact = [](void* context, int sphere, const float* p, double limit) {
      return static_cast<Impl*>(context)->exact_distance(sphere, p, limit);
    };
    scratch_->context = this;
    weights_.setOnes(model.dof());
  }

  void set_environment(const scene::Environment& environment, double time_s) {
    environment_ = &environment;
    edge_.set_environment(environment, time_s);
    field_ = environment.distance_field();
    std::fill(hints_.begin(), hints_.end(), Hint{-1, -1});
    for (kernel::Hot& hot : scratch_->hot) hot = {-1, -1};
    in_lanes_ = arm_.fits() && field_ != nullptr;
    if (!in_lanes_) return;
    place_frame();
    add_primitives(time_s);
  }

  void set_margins(const Margins& margins) {
    full_ = margins.full_m();
    self_most_ = margins.self_most_m();
    edge_.set_self_most(self_most_);
    for (Index j = 0; j < model_.dof(); ++j) weights_[j] = margins.weight(j);
    const auto& places = margins.places();
    if (place_q_.cols() < static_cast<Index>(places.size()) || place_q_.rows() != model_.dof())
      place_q_.resize(model_.dof(),
                      std::max<Index>(kernel::places_max, static_cast<Index>(places.size())));
    places_.clear();
    for (const auto& place : places) {
      place_q_.col(static_cast<Index>(places_.size())) = place.q;
      places_.push_back({place.margin, place.near, place.far});
    }
  }

  bool motion_clear(const VectorXd& a, const VectorXd& b) {
    if (!in_lanes_ || !set_line(a, b)) {
      ++counts_.whole;
      return exact_clear(a, b, 0.0, 1.0);
    }
    const double length = dq_.norm();
    int blocks = 1;  // a power of two, so that middles and widths are exact
    while (blocks < blocks_max && blocks * block_length < length) blocks *= 2;
    open_.clear();
    kernel::Batch batch{};
    batch.width = 1.0F / static_cast<float>(kernel::lanes * blocks);
    batch.active = 0xffff;
    for (int k = 0; k < blocks; ++k) {
      // The lanes of each block are spread over the whole motion: collisions show early.
      for (int l = 0; l < kernel::lanes; ++l)
        batch.s[l] = (static_cast<float>(l * blocks + k) + 0.5F) * batch.width;
      if (!run(batch)) return false;
    }
    return divide_open() && prove_open(a);
  }

  [[nodiscard]] long checks() const noexcept { return counts_.batches + edge_.checks(); }
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

 private:
  struct Hint {
    std::int32_t map, unknown;
  };
  struct PlaceMargin {
    double margin, near, far;
  };

  // The frame of the check has the axes of the map, and its origin at a corner of a voxel near the
  // base, so that coordinates are small whatever those of the map are.
  void place_frame() {
    const scene::DistanceField::View view = field_->view();
    const geometry::SE3& map = environment_->map_pose();
    const bool gridded = view.resolution_m > 0.0;
    Vector3d origin = map.inverse() * model_.base().p();
    std::array<double, 3> corner{};
    if (gridded)
      for (std::size_t i = 0; i < 3; ++i) {
        corner[i] = std::round(origin[static_cast<Index>(i)] / view.resolution_m);
        origin[static_cast<Index>(i)] = corner[i] * view.resolution_m;
      }
    origin_ = origin;
    frame_ = geometry::SE3{map.R(), map * origin};
    arm_.place(frame_);
    kernel::Field& field = world_.field;
    field = {};
    const double u = LineArm::unit_roundoff, extent = arm_.extent_m();
    world_.pair_slack = inflated(2.0 * arm_.position_rounding_m() + 24.0 * u * extent);
    world_.map_slack = 0.0F;
    if (!gridded || field_->empty()) return;
    field.values = view.values;
    double most = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      field.count[i] = view.count[i];
      const double offset = corner[i] - view.lo[i];
      field.offset[i] = static_cast<float>(offset);
      most = std::max({most, static_cast<double>(view.count[i]), std::abs(offset)});
    }
    const double h = view.resolution_m;
    field.inverse = static_cast<float>(1.0 / h);
    field.resolution = static_cast<float>(h);
    field.unit = static_cast<float>(view.unit_m);
    // docs/theory.md (17.15)
    const double cell = std::numbers::sqrt3 * u * (3.0 * extent + 2.0 * h * most);
    world_.map_slack = inflated(arm_.position_rounding_m() + cell + 1000.0 * u * h +
                                8.0 * u * (extent + 25.0 * h));
    constexpr double exact_float = 1 << 24;
    in_lanes_ = most < exact_float;
  }

  void add_primitives(double time_s) {
    primitives_.clear();
    const geometry::SE3 inverse = frame_.inverse();
    for (const scene::Obstacle& obstacle : environment_->obstacles()) {
      if (!scene::exists(obstacle, time_s) || obstacle.shape == scene::Shape::frame) continue;
      if (primitives_.size() == kernel::primitives_max) {
        in_lanes_ = false;
        return;
      }
      const scene::Placed placed = scene::placed_at(obstacle, time_s);
      primitives_.push_back(primitive_of(obstacle, inverse * placed.pose, placed.nearer_m,
                                         arm_.extent_m(), arm_.position_rounding_m()));
    }
    world_.primitives = primitives_.data();
    world_.primitive_count = static_cast<int>(primitives_.size());
  }

  // Constants of a line. @return false if it is not one for the lanes
  bool set_line(const VectorXd& a, const VectorXd& b) {
    dq_ = b - a;
    abs_dq_ = dq_.cwiseAbs();
    kernel::Line& line = *line_;
    for (Index j = 0; j < a.size(); ++j) {
      const kernel::Joint& joint = arm_.view().chain.joints[j];
      if (joint.turn == 0.0F) {
        if (!(std::max(std::abs(a[j]), std::abs(b[j])) <= arm_.travel(j))) return false;
        line.start[j] = static_cast<float>(a[j]);
        line.step[j] = static_cast<float>(dq_[j]);
        continue;
      }
      if (!(abs_dq_[j] <= LineArm::step_max)) return false;
      const double turn = static_cast<double>(joint.turn);
      line.start[j] = static_cast<float>(std::remainder(
          turn * a[j] + joint_offset(model_, static_cast<std::size_t>(j)), 2.0 * std::numbers::pi));
      line.step[j] = static_cast<float>(turn * dq_[j]);
    }
    arm_.levers().curvature(dq_, curvature_);
    part_kappa_.noalias() = arm_.part_levers() * curvature_;
    for (Index i = 0; i < part_kappa_.size(); ++i) line.kappa[i] = inflated(part_kappa_[i]);
    pair_way_.noalias() = arm_.levers().pairs() * abs_dq_;
    for (Index i = 0; i < pair_way_.size(); ++i) line.way[i] = inflated(pair_way_[i]);
    line.speed_slack = inflated(arm_.velocity_rounding() * abs_dq_.sum());
    return set_places(a);
  }

  bool set_places(const VectorXd& a) {
    kernel::Line& line = *line_;
    line.full_margin = inflated(full_);
    line.self_most = inflated(self_most_);
    double square = 0.0;
    for (Index j = 0; j < a.size(); ++j) {
      line.weighted_step[j] = static_cast<float>(weights_[j] * dq_[j]);
      square += std::pow(weights_[j] * dq_[j], 2);
    }
    const double length = std::sqrt(square);
    line.weighted_length = inflated(length);
    line.place_count = 0;
    double farthest = 0.0;
    for (std::size_t k = 0; k < places_.size(); ++k) {
      const double distance = distance_from(k, a);
      if (distance - length > places_[k].far) continue;
      if (line.place_count == kernel::places_max) return false;
      kernel::Place& place = line.places[line.place_count++];
      for (Index j = 0; j < a.size(); ++j)
        place.apart[j] =
            static_cast<float>(weights_[j] * (a[j] - place_q_(j, static_cast<Index>(k))));
      place.margin = inflated(places_[k].margin);
      place.near = static_cast<float>(places_[k].near / inflation);
      place.inverse_range = inflated(1.0 / (places_[k].far - places_[k].near));
      farthest = std::max(farthest, distance);
    }
    constexpr double roundings = 32.0;
    line.distance_slack = inflated(roundings * LineArm::unit_roundoff * (farthest + length));
    return true;
  }

  [[nodiscard]] double distance_from(std::size_t place, const VectorXd& q) const {
    double square = 0.0;
    for (Index j = 0; j < q.size(); ++j)
      square += std::pow(weights_[j] * (q[j] - place_q_(j, static_cast<Index>(place))), 2);
    return std::sqrt(square);
  }

  bool run(const kernel::Batch& batch) {
    ++counts_.batches;
    world_.primitives = primitives_.data();
    if (!kernels_.check(arm_.view(), world_, *line_, batch, *scratch_)) return false;
    for (int i = 0; i < scratch_->open_count; ++i) open_.push_back(scratch_->open[i]);
    return true;
  }

  // Divides what is open by four, four pieces in a batch.
  bool divide_open() {
    std::size_t from = 0;
    for (int division = 0; division < divisions; ++division) {
      const std::size_t to = open_.size();
      for (std::size_t i = from; i < to; i += 4)
        if (!divide(i, std::min<std::size_t>(4, to - i))) return false;
      from = to;
    }
    open_.erase(open_.begin(), open_.begin() + static_cast<std::ptrdiff_t>(from));
    return true;
  }

  bool divide(std::size_t first, std::size_t count) {
    std::array<kernel::Open, 4> pieces;
    kernel::Batch batch{};
    for (std::size_t k = 0; k < 4; ++k) {
      pieces[k] = open_[first + std::min(k, count - 1)];
      batch.pieces[k] = &pieces[k];
      for (std::size_t l = 0; l < 4; ++l)
        batch.s[4 * k + l] =
            pieces[k].s + pieces[k].width * (0.25F * static_cast<float>(l) - 0.375F);
    }
    batch.width = 0.25F * pieces[0].width;
    batch.active = 0xffffU >> (16U - 4U * static_cast<unsigned>(count));
    return run(batch);
  }

  // What is open after that is proved exactly, for the shapes and pairs that are open.
  bool prove_open(const VectorXd& a) {
    for (const kernel::Open& open : open_) {
      ++counts_.last_resort;
      subjects_.clear();
      const int shapes = static_cast<int>(model_.shapes().size());
      each_bit(open.pairs,
               [&](std::size_t pair) { subjects_.push_back(shapes + static_cast<int>(pair)); });
      each_bit(open.spheres, [&](std::size_t sphere) {
        const int shape = arm_.shape_of(sphere);
        if (subjects_.empty() || subjects_.back() != shape) subjects_.push_back(shape);
      });
      const double s = static_cast<double>(open.s), half = 0.5 * static_cast<double>(open.width);
      qa_ = a + (s - half) * dq_;
      qb_ = a + (s + half) * dq_;
      if (!edge_.motion_clear(qa_, qb_, static_cast<double>(open.margin), subjects_)) return false;
    }
    return true;
  }

  template <std::size_t words, class Use>
  static void each_bit(const std::uint64_t (&bits)[words], const Use& use) {
    for (std::size_t i = 0; i < words; ++i)
      for (std::uint64_t rest = bits[i]; rest != 0; rest &= rest - 1U)
        use(64 * i + static_cast<std::size_t>(std::countr_zero(rest)));
  }

  double exact_distance(int sphere, const float* p, double limit) {
    ++counts_.exact;
    const Vector3d point = origin_ + Vector3d(p[0], p[1], p[2]);
    Hint& hint = hints_[static_cast<std::size_t>(arm_.shape_of(static_cast<std::size_t>(sphere)))];
    double distance = environment_->map_field().distance(point, point, limit, hint.map);
    if (environment_->summary().unknown == scene::UnknownPolicy::block)
      distance = environment_->unknown_field().distance(point, point, distance, hint.unknown);
    return distance;
  }

  // The whole check without lanes, on the piece of the line from a to b that begins at s. It is
  // divided where the margins vary.
  bool exact_clear(const VectorXd& a, const VectorXd& b, double s, double width) {
    qa_ = a + s * (b - a);
    qb_ = a + (s + width) * (b - a);
    double square = 0.0;
    for (Index j = 0; j < a.size(); ++j) square += std::pow(weights_[j] * (qb_[j] - qa_[j]), 2);
    const double length = std::sqrt(square);
    double most = full_, least = full_;
    dq_ = 0.5 * (qa_ + qb_);
    for (std::size_t k = 0; k < places_.size(); ++k) {
      const double distance = distance_from(k, dq_);
      most = std::min(most, margin_at(places_[k], distance + 0.5 * length));
      least = std::min(least, margin_at(places_[k], distance - 0.5 * length));
    }
    if (most - least <= constant_margin_m || length <= shortest_piece)
      return edge_.motion_clear(qa_, qb_, most);
    const double half = 0.5 * width;
    return exact_clear(a, b, s + half, half) && exact_clear(a, b, s, half);
  }

  [[nodiscard]] double margin_at(const PlaceMargin& place, double distance) const {
    const double share = std::clamp((distance - place.near) / (place.far - place.near), 0.0, 1.0);
    return place.margin + share * (full_ - place.margin);
  }

  const model::Model& model_;
  LineArm arm_;
  EdgeCheck edge_;
  const kernel::LineKernels& kernels_;
  const scene::Environment* environment_ = nullptr;
  std::shared_ptr<const scene::DistanceField> field_;
  bool in_lanes_ = false;
  Vector3d origin_ = Vector3d::Zero();  // of the frame, in that of the map
  geometry::SE3 frame_;
  kernel::World world_{};
  std::vector<kernel::Primitive> primitives_;
  std::unique_ptr<kernel::Scratch> scratch_;
  std::unique_ptr<kernel::Line> line_;
  std::vector<Hint> hints_;
  std::vector<kernel::Open> open_;
  std::vector<int> subjects_;
  double full_ = 0.0, self_most_ = std::numeric_limits<double>::infinity();
  VectorXd weights_;
  Eigen::MatrixXd place_q_;  // dof × places
  std::vector<PlaceMargin> places_;
  VectorXd dq_, abs_dq_, curvature_, part_kappa_, pair_way_, qa_, qb_;
  Counts counts_;
};

LineCheck::LineCheck(const model::Model& model, const scene::SelfField* self)
    : impl_(std::make_unique<Impl>(model, self)) {}
LineCheck::LineCheck(LineCheck&&) noexcept = default;
LineCheck& LineCheck::operator=(LineCheck&&) noexcept = default;
LineCheck::~LineCheck() = default;

void LineCheck::set_environment(const scene::Environment& environment, double time_s) {
  impl_->set_environment(environment, time_s);
}
void LineCheck::set_margins(const Margins& margins) {
  impl_->set_margins(margins);
}
bool LineCheck::motion_clear(const VectorXd& a, const VectorXd& b) {
  return impl_->motion_clear(a, b);
}
long LineCheck::checks() const noexcept {
  return impl_->checks();
}
const LineCheck::Counts& LineCheck::counts() const noexcept {
  return impl_->counts();
}

}  // namespace hamelin::search
