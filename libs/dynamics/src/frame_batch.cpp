#include "hamelin/dynamics/frame_batch.hpp"

#include <cstddef>
#include <vector>

#include "frame_batch_kernel.hpp"
#include "hamelin/core/isa_kernels.hpp"
#include "kinematics.hpp"
#include "state_blocks.hpp"

namespace hamelin::dynamics {

HAMELIN_SELECT_KERNELS(FrameBatchKernel, frame_batch_set)

struct FrameBatch::Data {
  Data(const Model& model, int frame, const Settings& settings)
      : owner(model),
        kernel(&select_frame_batch_set(settings.isa)),
        blocks("FrameBatch", settings.threads, 12 + 6 * static_cast<std::size_t>(model.dof()),
               kernel->bytes(static_cast<std::size_t>(model.dof()))),
        links(batch_links(model)) {
    const auto& named = named_frame("FrameBatch", model, frame);
    call.dof = links.size();
    call.moving = static_cast<std::size_t>(named.link + 1);
    call.root = batch_pose(model.root());
    call.frame = batch_pose(named.in_link);
    call.local = settings.reference == Reference::local;
    call.about_origin = settings.reference == Reference::world;
    call.links = links.data();
  }

  WorkspaceOwner owner;
  const FrameBatchKernel* kernel;
  StateBlocks blocks;
  std::vector<BatchLink> links;
  FrameBatchCall call{};
};

FrameBatch::FrameBatch(const Model& model, int frame, const Settings& settings)
    : data_(std::make_unique<Data>(model, frame, settings)) {}
FrameBatch::~FrameBatch() = default;

void FrameBatch::compute(const ConstStatesRef& q, double* poses, double* J) {
  const auto stride = static_cast<std::size_t>(q.outerStride());
  data_->blocks.run(static_cast<std::size_t>(q.cols()), stride,
                    {{poses, 12}, {J, 6 * data_->links.size()}},
                    [&](const StateBlocks::Block& block) {
                      FrameBatchCall call = data_->call;
                      call.memory = block.memory;
                      call.states = block.states;
                      call.stride = stride;
                      call.result_stride = block.stride;
                      call.q = q.data() + block.first;
                      call.poses = block.results[0];
                      call.jacobians = block.results[1];
                      data_->kernel->evaluate(call);
                    });
}

void FrameBatch::poses(const ConstStatesRef& q, StatesRef poses) {
  check_states("FrameBatch", "q", q, q, data_->owner.dof);
  check_result("FrameBatch", "poses", poses, 12, q);
  compute(q, poses.data(), nullptr);
}

void FrameBatch::jacobians(const ConstStatesRef& q, StatesRef J) {
  check_states("FrameBatch", "q", q, q, data_->owner.dof);
  check_result("FrameBatch", "J", J, 6 * data_->owner.dof, q);
  compute(q, nullptr, J.data());
}

void FrameBatch::evaluate(const ConstStatesRef& q, StatesRef poses, StatesRef J) {
  check_states("FrameBatch", "q", q, q, data_->owner.dof);
  check_result("FrameBatch", "poses", poses, 12, q);
  check_result("FrameBatch", "J", J, 6 * data_->owner.dof, q);
  compute(q, poses.data(), J.data());
}

}  // namespace hamelin::dynamics
