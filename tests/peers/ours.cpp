#include "hamelin/integration/integrator.hpp"
#include "peer.hpp"

namespace hamelin::peers {

namespace {

class OurStepper final : public Stepper {
 public:
  OurStepper(const model::Model& model, const std::string& name)
      : integrator_(integration::make_integrator(name, model)) {}
  void set(const VectorXd& q, const VectorXd& v) override { state_ = integrator_->start(q, v); }
  bool step(double h) override { return integrator_->step(state_, {}, h).converged; }
  void get(VectorXd& q, VectorXd& v) override {
    q = state_.q;
    integrator_->velocity(state_, v);
  }

 private:
  std::unique_ptr<integration::Integrator> integrator_;
  integration::State state_;
};

class Ours final : public Peer {
 public:
  explicit Ours(const model::Robot& robot) : model_(robot), ws_(model_) {}
  [[nodiscard]] std::string name() const override { return "hamelin"; }
  [[nodiscard]] std::string instruction_set() const override {
    return std::string(name_of(default_isa()));
  }
  void inverse_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& a,
                        VectorXd& tau) override {
    dynamics::inverse_dynamics(model_, ws_, q, v, a, tau);
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& tau,
                        VectorXd& a) override {
    dynamics::forward_dynamics(model_, ws_, q, v, tau, a);
  }
  [[nodiscard]] std::vector<std::string> steppers() const override {
    return integration::integrator_names();
  }
  [[nodiscard]] std::unique_ptr<Stepper> stepper(const std::string& name) override {
    return std::make_unique<OurStepper>(model_, name);
  }

 private:
  model::Model model_;
  dynamics::Workspace ws_;
};

}  // namespace

std::unique_ptr<Peer> make_ours(const model::Robot& robot) {
  return std::make_unique<Ours>(robot);
}

}  // namespace hamelin::peers
