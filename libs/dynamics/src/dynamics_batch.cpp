#include "hamelin/dynamics/dynamics_batch.hpp"

#include <cstddef>
#include <initializer_list>
#include <utility>
#include <variant>
#include <vector>

#include "derivative_links.hpp"
#include "dynamics_batch_kernel.hpp"
#include "hamelin/core/isa_kernels.hpp"
#include "hamelin/dynamics/kernel/dispatch.hpp"
#include "kinematics.hpp"
#include "state_blocks.hpp"

namespace hamelin::dynamics {

HAMELIN_SELECT_KERNELS(DynamicsBatchSet, dynamics_batch_set)

namespace {

constexpr const char* batch_name = "DynamicsBatch";

std::size_t packet_bytes(const Model& model, const DynamicsBatchSet& set) {
  return kernel::with_group(model, set, [&](const auto& kernels, const auto& chain) {
    return kernels.bytes(chain.links.size());
  });
}

// The rows of all results of forward_dynamics_derivatives.
std::size_t most_rows(std::size_t dof) {
  return 3 * dof * dof + dof;
}

BatchPose about_base(const Model& model) {
  return batch_pose({model.root().R(), model.root().p() - model.base().p()});
}

}  // namespace

struct DynamicsBatch::Data {
  Data(const Model& given, const Settings& settings)
      : owner(given),
        chain(given.chain()),
        has_prismatic_or_rotor(given.has_prismatic_or_rotor()),
        set(&select_dynamics_batch_set(settings.isa)),
        blocks(batch_name, settings.threads, most_rows(static_cast<std::size_t>(given.dof())),
               packet_bytes(given, *set)),
        links(batch_links(given)),
        bodies(derivative_links(given)),
        constants{links.size(), links.data(), bodies.data(), about_base(given),
                  vec3(given.gravity())} {}

  // Calls f(call) for blocks of states.
  template <class F>
  void run(const ConstStatesRef& q, DynamicsBatchCall call, const F& f) {
    const std::size_t n = links.size();
    call.model = &constants;
    call.stride = static_cast<std::size_t>(q.outerStride());
    blocks.run(
        static_cast<std::size_t>(q.cols()), call.stride,
        {{call.by_q, n * n}, {call.by_v, n * n}, {call.by_third, n * n}, {call.acceleration, n}},
        [&](const StateBlocks::Block& block) {
          DynamicsBatchCall part = call;
          part.memory = block.memory;
          part.states = block.states;
          part.result_stride = block.stride;
          for (const double** x : {&part.q, &part.v, &part.x})
            if (*x != nullptr) *x += block.first;
          part.by_q = block.results[0];
          part.by_v = block.results[1];
          part.by_third = block.results[2];
          part.acceleration = block.results[3];
          f(part);
        });
  }

  // Calls f(kernels, chain).
  template <class F>
  void with_kernels(const F& f) const {
    kernel::with_group(chain, has_prismatic_or_rotor, *set, f);
  }

  WorkspaceOwner owner;
  std::variant<model::SpatialChain, model::PlanarChain> chain;
  bool has_prismatic_or_rotor;
  const DynamicsBatchSet* set;
  StateBlocks blocks;
  std::vector<BatchLink> links;
  std::vector<kernel::DerivativeLink> bodies;
  DynamicsBatchModel constants;
};

DynamicsBatch::DynamicsBatch(const Model& model, const Settings& settings)
    : data_(std::make_unique<Data>(model, settings)) {}
DynamicsBatch::~DynamicsBatch() = default;

namespace {

// Results that take no memory of the arguments, each `rows` × states.
void check_results(const std::initializer_list<std::pair<const char*, const StatesRef*>>& results,
                   Eigen::Index rows,
                   const std::initializer_list<std::pair<const char*, const ConstStatesRef*>>& in) {
  const ConstStatesRef& q = *in.begin()->second;
  for (const auto& [name, x] : results) {
    check_result(batch_name, name, *x, rows, q);
    for (const auto& [other, y] : in) check_apart(batch_name, name, *x, other, *y);
  }
}

}  // namespace

void DynamicsBatch::mass_matrix(const ConstStatesRef& q, StatesRef M) {
  const Eigen::Index n = data_->owner.dof;
  check_states(batch_name, "q", q, q, n);
  check_results({{"M", &M}}, n * n, {{"q", &q}});
  DynamicsBatchCall call{};
  call.q = q.data();
  call.by_third = M.data();
  data_->with_kernels([&](const auto& kernels, const auto& chain) {
    data_->run(q, call, [&](const DynamicsBatchCall& part) { kernels.mass_matrix(chain, part); });
  });
}

void DynamicsBatch::inverse_dynamics_derivatives(const ConstStatesRef& q, const ConstStatesRef& v,
                                                 const ConstStatesRef& a, StatesRef dtau_dq,
                                                 StatesRef dtau_dv, StatesRef dtau_da) {
  const Eigen::Index n = data_->owner.dof;
  check_states(batch_name, "q", q, q, n);
  check_states(batch_name, "v", v, q, n);
  check_states(batch_name, "a", a, q, n);
  check_results({{"dtau_dq", &dtau_dq}, {"dtau_dv", &dtau_dv}, {"dtau_da", &dtau_da}}, n * n,
                {{"q", &q}, {"v", &v}, {"a", &a}});
  DynamicsBatchCall call{};
  call.q = q.data();
  call.v = v.data();
  call.x = a.data();
  call.by_q = dtau_dq.data();
  call.by_v = dtau_dv.data();
  call.by_third = dtau_da.data();
  data_->run(q, call, [&](const DynamicsBatchCall& part) {
    data_->set->inverse_dynamics_derivatives(part);
  });
}

void DynamicsBatch::forward_dynamics_derivatives(const ConstStatesRef& q, const ConstStatesRef& v,
                                                 const ConstStatesRef& tau, StatesRef a,
                                                 StatesRef da_dq, StatesRef da_dv,
                                                 StatesRef da_dtau) {
  const Eigen::Index n = data_->owner.dof;
  check_states(batch_name, "q", q, q, n);
  check_states(batch_name, "v", v, q, n);
  check_states(batch_name, "tau", tau, q, n);
  check_results({{"a", &a}}, n, {{"q", &q}, {"v", &v}, {"tau", &tau}});
  check_results({{"da_dq", &da_dq}, {"da_dv", &da_dv}, {"da_dtau", &da_dtau}}, n * n,
                {{"q", &q}, {"v", &v}, {"tau", &tau}});
  DynamicsBatchCall call{};
  call.q = q.data();
  call.v = v.data();
  call.x = tau.data();
  call.acceleration = a.data();
  call.by_q = da_dq.data();
  call.by_v = da_dv.data();
  call.by_third = da_dtau.data();
  data_->with_kernels([&](const auto& kernels, const auto& chain) {
    data_->run(q, call, [&](const DynamicsBatchCall& part) {
      kernels.forward_dynamics_derivatives(chain, part);
    });
  });
}

}  // namespace hamelin::dynamics
