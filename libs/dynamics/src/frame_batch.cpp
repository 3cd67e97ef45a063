#include "hamelin/dynamics/frame_batch.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <thread>
#include <variant>
#include <vector>

#include "frame_batch_kernel.hpp"
#include "hamelin/core/isa_kernels.hpp"
#include "kinematics.hpp"

namespace hamelin::dynamics {

HAMELIN_SELECT_KERNELS(FrameBatchKernel, frame_batch_set)

namespace {

BatchPose batch_pose(const geometry::SE3& g) {
  return {vec3(g.R().col(0)), vec3(g.R().col(1)), vec3(g.R().col(2)), vec3(g.p())};
}

BatchLink batch_link(const model::SpatialLink& l) {
  return {l.cos_alpha, l.sin_alpha, 1.0, l.offset, l.p0, {0.0, -l.sin_alpha, l.cos_alpha},
          l.prismatic, false};
}

BatchLink batch_link(const model::PlanarLink& l) {
  return {1.0,
          0.0,
          l.direction,
          l.offset,
          {l.p0x, l.p0y, 0.0},
          {std::cos(l.offset), std::sin(l.offset), 0.0},
          l.prismatic,
          l.prismatic};
}

std::size_t checked_threads(int threads) {
  if (threads < 1)
    throw Error(ErrorCode::usage,
                formatted("FrameBatch: {} threads given, expected at least 1", threads));
  return static_cast<std::size_t>(threads);
}

}  // namespace

struct FrameBatch::Data {
  Data(const Model& model, int frame, const Settings& settings)
      : owner(model),
        kernel(&select_frame_batch_set(settings.isa)),
        bytes(kernel->bytes(static_cast<std::size_t>(model.dof()))),
        memory(bytes * checked_threads(settings.threads)),
        threads(static_cast<std::size_t>(settings.threads)) {
    const auto& named = named_frame("FrameBatch", model, frame);
    std::visit(
        [&](const auto& chain) {
          for (const auto& link : chain.links) links.push_back(batch_link(link));
        },
        model.chain());
    call.dof = links.size();
    call.moving = static_cast<std::size_t>(named.link + 1);
    call.root = batch_pose(model.root());
    call.frame = batch_pose(named.in_link);
    call.local = settings.reference == Reference::local;
    call.about_origin = settings.reference == Reference::world;
    call.links = links.data();
  }
  // Of the states of a call, those of one thread.
  void evaluate(std::size_t thread) noexcept {
    constexpr std::size_t cache_line = 8;  // numbers that two threads should not share
    const std::size_t all = (call.states + cache_line - 1) / cache_line,
                      first = all * thread / threads * cache_line,
                      end = std::min(call.states, all * (thread + 1) / threads * cache_line);
    if (first >= end) return;
    FrameBatchCall part = call;
    part.memory = static_cast<std::byte*>(memory.get()) + thread * bytes;
    part.states = end - first;
    part.q += first;
    if (part.poses != nullptr) part.poses += first;
    if (part.jacobians != nullptr) part.jacobians += first;
    kernel->evaluate(part);
  }

  WorkspaceOwner owner;
  const FrameBatchKernel* kernel;
  std::size_t bytes;  ///< of scratch memory per thread
  AlignedBuffer memory;
  std::size_t threads;
  std::vector<BatchLink> links;
  FrameBatchCall call{};
};

FrameBatch::FrameBatch(const Model& model, int frame, const Settings& settings)
    : data_(std::make_unique<Data>(model, frame, settings)) {}
FrameBatch::~FrameBatch() = default;

void FrameBatch::compute(const ConstStatesRef& q, double* poses, double* J) {
  FrameBatchCall& call = data_->call;
  call.states = static_cast<std::size_t>(q.cols());
  call.stride = static_cast<std::size_t>(q.outerStride());
  call.q = q.data();
  call.poses = poses;
  call.jacobians = J;
  std::vector<std::jthread> others;
  for (std::size_t thread = 1; thread < data_->threads; ++thread)
    others.emplace_back([this, thread] { data_->evaluate(thread); });
  data_->evaluate(0);
}

namespace {

// Whether two blocks with one row stride have a number in common.
bool overlap(const StatesRef& a, const ConstStatesRef& b) {
  const auto address = [](const double* x) { return reinterpret_cast<std::intptr_t>(x); };
  const auto apart =
      (address(a.data()) - address(b.data())) / static_cast<std::intptr_t>(sizeof(double));
  const Eigen::Index stride = std::max<Eigen::Index>(1, b.outerStride());
  const Eigen::Index row = apart / stride - (apart % stride < 0 ? 1 : 0);
  for (const Eigen::Index k : {row, row + 1})
    if (std::abs(apart - k * stride) < b.cols() && k < b.rows() && -k < a.rows()) return true;
  return false;
}

void check_block(const char* argument, const StatesRef& x, Eigen::Index rows,
                 const ConstStatesRef& q, Eigen::Index dof) {
  if (q.rows() != dof || x.rows() != rows || x.cols() != q.cols() ||
      x.outerStride() != q.outerStride())
    throw Error(
        ErrorCode::usage,
        formatted("FrameBatch: {}: {} x {} numbers with row stride {} given, for q of {} x "
                  "{} with row stride {}; expected {} x {} for q of {} rows, and one stride",
                  argument, x.rows(), x.cols(), x.outerStride(), q.rows(), q.cols(),
                  q.outerStride(), rows, q.cols(), dof));
  if (overlap(x, q))
    throw Error(ErrorCode::usage,
                formatted("FrameBatch: {}: shares memory with q, expected other memory", argument));
}

}  // namespace

void FrameBatch::poses(const ConstStatesRef& q, StatesRef poses) {
  check_block("poses", poses, 12, q, data_->owner.dof);
  compute(q, poses.data(), nullptr);
}

void FrameBatch::jacobians(const ConstStatesRef& q, StatesRef J) {
  check_block("J", J, 6 * data_->owner.dof, q, data_->owner.dof);
  compute(q, nullptr, J.data());
}

void FrameBatch::evaluate(const ConstStatesRef& q, StatesRef poses, StatesRef J) {
  check_block("poses", poses, 12, q, data_->owner.dof);
  check_block("J", J, 6 * data_->owner.dof, q, data_->owner.dof);
  compute(q, poses.data(), J.data());
}

}  // namespace hamelin::dynamics
