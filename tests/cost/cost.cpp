// hamelin_cost list | CASE library|without COUNT: executes a case COUNT times; run.sh counts the
// instructions.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/model/make_chain.hpp"
#include "kernels.hpp"

using namespace hamelin;
using Eigen::VectorXd;

namespace {

constexpr int links = 20;

/// rk4 without support for channels; the code around a step is that of the library.
class PlainRk4 final : public integration::Integrator {
 public:
  explicit PlainRk4(const model::Model& model) : Integrator("rk4", model, {}) {
    q_ = v_ = q_sum_ = v_sum_ = acceleration_ = none_ = VectorXd::Zero(model.dof());
    prepare({1, model.fingerprint()});
  }
  [[nodiscard]] std::string criterion() const override { return "none"; }
  [[nodiscard]] int order() const override { return 4; }

 protected:
  using In = dynamics::ConstVectorRef;
  void begin(integration::State& state, const In& v0) override { state.v = v0; }
  void node_velocity(const integration::State& state, dynamics::VectorRef v) const override {
    v = state.v;
  }
  void add_momentum(integration::State&, const In&) override {}
  void replace_velocity(integration::State& state, const In& v) override { state.v = v; }
  integration::StepReport attempt(integration::State& state, const integration::Channels&,
                                  double h) override {
    static constexpr std::array<double, 4> c{0.0, 0.5, 0.5, 1.0},
        b{1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    integration::StepReport report;
    q_sum_ = state.q;
    v_sum_ = state.v;
    v_ = state.v;
    acceleration_.setZero();
    for (std::size_t i = 0; i < 4; ++i) {
      q_ = state.q + c[i] * h * v_;
      v_ = state.v + c[i] * h * acceleration_;
      dynamics::forward_dynamics(model_, ws_, q_, v_, none_, acceleration_);
      ++report.evaluations;
      q_sum_ += b[i] * h * v_;
      v_sum_ += b[i] * h * acceleration_;
    }
    report.converged = q_sum_.allFinite() && v_sum_.allFinite();
    if (!report.converged) return report;
    state.q = q_sum_;
    state.v = v_sum_;
    return report;
  }

 private:
  VectorXd q_, v_, q_sum_, v_sum_, acceleration_, none_;
};

/// Steps without damping, friction, gyroscopic terms and held torque.
void steps(bool library, long count) {
  const model::Model model(model::make_chain({links, "x,z,x", 0.2, 1.0, 0.03}));
  std::unique_ptr<integration::Integrator> integrator;
  if (library)
    integrator = integration::make_integrator("rk4", model);
  else
    integrator = std::make_unique<PlainRk4>(model);
  auto state = integrator->start(VectorXd::Zero(links), VectorXd::Zero(links));
  const integration::Channels nothing;
  for (long k = 0; k < count; ++k)
    if (!integrator->step(state, nothing, 1e-4).converged) std::abort();
}

/// Forward or inverse dynamics of a chain without rotor inertia.
void dynamics_calls(bool forward, bool library, long count) {
  const model::Model model(model::make_chain({links, "x,z,x", 0.2, 1.0, 0.03}));
  dynamics::Workspace ws(model);
  const auto& chain = std::get<model::SpatialChain>(model.chain());
  const std::unique_ptr<void, decltype(&std::free)> memory(
      std::aligned_alloc(64, (cost::memory_bytes(links) + 63) / 64 * 64), std::free);
  const VectorXd q = VectorXd::LinSpaced(links, -1.0, 1.0),
                 v = VectorXd::LinSpaced(links, 0.5, -0.7);
  const VectorXd x = VectorXd::LinSpaced(links, -2.0, 3.0);
  VectorXd y(links);
  for (long k = 0; k < count; ++k) {
    if (library && forward)
      dynamics::forward_dynamics(model, ws, q, v, x, y);
    else if (library)
      dynamics::inverse_dynamics(model, ws, q, v, x, y);
    else if (forward)
      cost::forward_dynamics(chain, memory.get(), q.data(), v.data(), x.data(), y.data());
    else
      cost::inverse_dynamics(chain, memory.get(), q.data(), v.data(), x.data(), y.data());
  }
  if (!y.allFinite()) std::abort();
}

}  // namespace

int main(int argc, char** argv) {
  if (const char* isa = std::getenv("HAMELIN_ISA"))
    set_default_isa(isa_from_name(isa, "HAMELIN_ISA"));
  const std::string name = argc > 1 ? argv[1] : "list";
  if (name == "list") {
    std::puts("rk4-no-channels\nforward-no-rotors\ninverse-no-rotors");
    return 0;
  }
  const bool library = argc > 2 && std::string(argv[2]) == "library";
  const long count = argc > 3 ? std::atol(argv[3]) : 1;
  if (name == "rk4-no-channels")
    steps(library, count);
  else
    dynamics_calls(name == "forward-no-rotors", library, count);
}
