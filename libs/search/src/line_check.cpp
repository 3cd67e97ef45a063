#include "hamelin/search/line_check.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "hamelin/core/isa_kernels.hpp"
#include "hamelin/search/edge_check.hpp"
#include "kernel/line_lanes.hpp"
#include "lane_chain.hpp"
#include "line_arm.hpp"
#include "line_margins.hpp"
#include "line_world.hpp"
#include "single_bounds.hpp"

namespace hamelin::search {

namespace kernel {
HAMELIN_SELECT_KERNELS(LineKernels, line_kernels)
}  // namespace kernel

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr double block_length = 0.7;  // of a motion per 16 pieces at first [rad or m]
constexpr int blocks_max = 64;
constexpr int divisions = 2;                // by four, before the exact check
constexpr double constant_margin_m = 2e-4;  // variation that is neglected by exact checks
constexpr double shortest_piece = 0.01;     // that exact checks divide [rad or m]
constexpr std::size_t open_reserve = 4096, wholes_reserve = 64;

}  // namespace

// A proof goes on batch by batch and posture by posture: blocks of the whole motion, then divisions
// of what they leave open, then exact proofs of what is open still.
class LineCheck::Impl {
 public:
  Impl(const model::Model& model, const scene::SelfField* self)
      : model_(model),
        arm_(model, self),
        world_(model, arm_),
        margins_(model.dof()),
        edge_(model, self),
        kernels_(kernel::select_line_kernels(default_isa())),
        scratch_(std::make_unique<kernel::Scratch>()),
        line_(std::make_unique<kernel::Line>()) {
    open_.reserve(open_reserve);
    wholes_.reserve(wholes_reserve);
    subjects_.reserve(model.shapes().size() + (self != nullptr ? self->pairs().size() : 0));
    for (auto* x : {&start_, &end_, &dq_, &curvature_, &qa_, &qb_, &abs_dq_})
      x->setZero(model.dof());
    part_kappa_.setZero(arm_.part_levers().rows());
    pair_way_.setZero(arm_.levers().pairs().rows());
    for (kernel::Hot& hot : scratch_->hot) hot = {-1, -1};
    scratch_->exact = [](void* context, int sphere, const float* p, double limit) {
      auto& self = *static_cast<Impl*>(context);
      ++self.counts_.exact;
      return self.world_.distance(sphere, p, limit);
    };
    scratch_->context = this;
  }

  void set_environment(const scene::Environment& environment, double time_s, bool movers) {
    edge_.set_environment(environment, time_s, movers);
    for (kernel::Hot& hot : scratch_->hot) hot = {-1, -1};
    in_lanes_ = world_.set(environment, time_s, movers);
  }

  void set_margins(const Margins& margins) {
    margins_.set(margins);
    edge_.set_self_most(margins_.self_most_m());
  }

  void begin_motion(const VectorXd& a, const VectorXd& b) {
    start_ = a;
    end_ = b;
    dq_ = b - a;
    open_.clear();
    wholes_.clear();
    exact_ = false;
    if (in_lanes_ && set_line()) {
      blocks_ = 1;  // a power of two, so that middles and widths are exact
      const double length = dq_.norm();
      while (blocks_ < blocks_max && blocks_ * block_length < length) blocks_ *= 2;
    } else {
      ++counts_.whole;
      blocks_ = 0;
      wholes_.push_back({0.0, 1.0});
    }
    block_ = division_ = 0;
    next_ = level_end_ = 0;
  }

  std::optional<bool> prove(long checks) {
    const long since = this->checks();
    long rest = checks;
    do {
      if (!next(rest)) return false;
      if (proved()) return true;
      rest = checks - (this->checks() - since);
    } while (rest > 0);
    return std::nullopt;
  }

  [[nodiscard]] long checks() const noexcept { return counts_.batches + edge_.checks(); }
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

 private:
  /// A piece of the motion that is proved without lanes.
  struct Whole {
    double s, width;  ///< where it begins
  };

  // Constants of a line. @return false if it is not one for the lanes
  bool set_line() {
    abs_dq_ = dq_.cwiseAbs();
    kernel::Line& line = *line_;
    for (Index j = 0; j < dq_.size(); ++j) {
      const kernel::Joint& joint = arm_.view().chain.joints[j];
      if (joint.turn == 0.0F) {
        if (!(std::max(std::abs(start_[j]), std::abs(end_[j])) <= arm_.travel(j))) return false;
        line.start[j] = static_cast<float>(start_[j]);
        line.step[j] = static_cast<float>(dq_[j]);
        continue;
      }
      if (!(abs_dq_[j] <= LineArm::step_max)) return false;
      const double turn = static_cast<double>(joint.turn);
      line.start[j] = static_cast<float>(
          std::remainder(turn * start_[j] + joint_offset(model_, static_cast<std::size_t>(j)),
                         2.0 * std::numbers::pi));
      line.step[j] = static_cast<float>(turn * dq_[j]);
    }
    arm_.levers().curvature(dq_, curvature_);
    part_kappa_.noalias() = arm_.part_levers() * curvature_;
    for (Index i = 0; i < part_kappa_.size(); ++i) line.kappa[i] = inflated(part_kappa_[i]);
    pair_way_.noalias() = arm_.levers().pairs() * abs_dq_;
    for (Index i = 0; i < pair_way_.size(); ++i) line.way[i] = inflated(pair_way_[i]);
    line.speed_slack = inflated(arm_.velocity_rounding() * abs_dq_.sum());
    return margins_.write(start_, dq_, line);
  }

  [[nodiscard]] bool proved() const noexcept {
    return block_ == blocks_ && next_ == open_.size() && wholes_.empty() && !exact_;
  }

  // The next batch, or an exact proof for so many postures. @return false if there is no proof
  bool next(long postures) {
    if (block_ < blocks_) return check_block();
    if (next_ == level_end_ && division_ < divisions) {
      ++division_;
      level_end_ = open_.size();
    }
    if (next_ < level_end_) return divide();
    if (!exact_) begin_exact();
    if (!exact_) return true;
    const std::optional<bool> clear = edge_.prove(postures);
    if (clear) exact_ = false;
    return clear.value_or(true);
  }

  // The lanes of each block are spread over the whole motion: collisions show early.
  bool check_block() {
    kernel::Batch batch{};
    batch.width = 1.0F / static_cast<float>(kernel::lanes * blocks_);
    batch.active = 0xffff;
    for (int l = 0; l < kernel::lanes; ++l)
      batch.s[l] = (static_cast<float>(l * blocks_ + block_) + 0.5F) * batch.width;
    ++block_;
    return run(batch);
  }

  // Divides up to four pieces that are open, by four.
  bool divide() {
    const std::size_t count = std::min<std::size_t>(4, level_end_ - next_);
    std::array<kernel::Open, 4> pieces;
    kernel::Batch batch{};
    for (std::size_t k = 0; k < 4; ++k) {
      pieces[k] = open_[next_ + std::min(k, count - 1)];
      batch.pieces[k] = &pieces[k];
      for (std::size_t l = 0; l < 4; ++l)
        batch.s[4 * k + l] =
            pieces[k].s + pieces[k].width * (0.25F * static_cast<float>(l) - 0.375F);
    }
    batch.width = 0.25F * pieces[0].width;
    batch.active = 0xffffU >> (16U - 4U * static_cast<unsigned>(count));
    next_ += count;
    return run(batch);
  }

  bool run(const kernel::Batch& batch) {
    ++counts_.batches;
    if (!kernels_.check(arm_.view(), world_.view(), *line_, batch, *scratch_)) return false;
    open_.insert(open_.end(), scratch_->open, scratch_->open + scratch_->open_count);
    return true;
  }

  // Begins the exact proof of a piece, or divides one on which the margins vary.
  void begin_exact() {
    if (wholes_.empty()) return begin_open(open_[next_++]);
    const Whole piece = wholes_.back();
    wholes_.pop_back();
    qa_ = start_ + piece.s * dq_;
    qb_ = start_ + (piece.s + piece.width) * dq_;
    const LineMargins::Range range = margins_.range(qa_, qb_);
    if (range.most - range.least <= constant_margin_m || range.length <= shortest_piece) {
      exact_ = true;
      return edge_.begin_motion(qa_, qb_, range.most);
    }
    const double half = 0.5 * piece.width;
    wholes_.push_back({piece.s, half});
    wholes_.push_back({piece.s + half, half});
  }

  // Of the shapes and pairs that are open.
  void begin_open(const kernel::Open& open) {
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
    qa_ = start_ + (s - half) * dq_;
    qb_ = start_ + (s + half) * dq_;
    exact_ = true;
    edge_.begin_motion(qa_, qb_, static_cast<double>(open.margin), subjects_);
  }

  template <std::size_t words, class Use>
  static void each_bit(const std::uint64_t (&bits)[words], const Use& use) {
    for (std::size_t i = 0; i < words; ++i)
      for (std::uint64_t rest = bits[i]; rest != 0; rest &= rest - 1U)
        use(64 * i + static_cast<std::size_t>(std::countr_zero(rest)));
  }

  const model::Model& model_;
  LineArm arm_;
  LineWorld world_;
  LineMargins margins_;
  EdgeCheck edge_;
  const kernel::LineKernels& kernels_;
  std::unique_ptr<kernel::Scratch> scratch_;
  bool in_lanes_ = false;
  // The motion, and the proof as far as it has come.
  VectorXd start_, end_, dq_;
  std::unique_ptr<kernel::Line> line_;
  int block_ = 0, blocks_ = 0, division_ = 0;
  std::vector<kernel::Open> open_;        // pieces, level by level of division
  std::size_t next_ = 0, level_end_ = 0;  // of them
  std::vector<Whole> wholes_;             // pieces of a motion that is not one for the lanes
  bool exact_ = false;                    // the proof by edge_ goes on
  std::vector<int> subjects_;
  VectorXd abs_dq_, curvature_, part_kappa_, pair_way_, qa_, qb_;
  Counts counts_;
};

LineCheck::LineCheck(const model::Model& model, const scene::SelfField* self)
    : impl_(std::make_unique<Impl>(model, self)) {}
LineCheck::LineCheck(LineCheck&&) noexcept = default;
LineCheck& LineCheck::operator=(LineCheck&&) noexcept = default;
LineCheck::~LineCheck() = default;

void LineCheck::set_environment(const scene::Environment& environment, double time_s, bool movers) {
  impl_->set_environment(environment, time_s, movers);
}
void LineCheck::set_margins(const Margins& margins) {
  impl_->set_margins(margins);
}
void LineCheck::begin_motion(const VectorXd& a, const VectorXd& b) {
  impl_->begin_motion(a, b);
}
std::optional<bool> LineCheck::prove(long checks) {
  return impl_->prove(checks);
}
long LineCheck::checks() const noexcept {
  return impl_->checks();
}
const LineCheck::Counts& LineCheck::counts() const noexcept {
  return impl_->counts();
}

}  // namespace hamelin::search
