#include "hamelin/integration/dense_output.hpp"

#include "channels/channel_forces.hpp"
#include "channels/check_channels.hpp"
#include "channels/wrench_forces.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/core/hermite.hpp"

namespace hamelin::integration {

struct DenseOutput::Node {
  explicit Node(Eigen::Index dof) : q(VectorXd::Zero(dof)), v(q), a(q) {}
  double time_s = 0.0;
  VectorXd q, v, a;
};

struct DenseOutput::Data {
  Data(const Model& given, Isa isa)
      : model(given),
        ws(given, isa),
        wrenches(given, ws),
        forces(given, wrenches),
        first(given.dof()),
        last(given.dof()) {}

  const Model& model;
  dynamics::Workspace ws;
  WrenchForces wrenches;
  ChannelForces forces;
  Node first, last;
  bool begun = false, ended = false;
};

DenseOutput::DenseOutput(const Model& model, Isa isa) : data_(std::make_unique<Data>(model, isa)) {}
DenseOutput::~DenseOutput() = default;

void DenseOutput::set(Node& node, const char* function, const Integrator& integrator,
                      const State& state, const Channels& channels) {
  check_size(function, "state.q", data_->model, state.q.size());
  if (!channels.none()) check_channels(function, data_->model, channels);
  integrator.velocity(state, node.v);
  node.time_s = state.time_s;
  node.q = state.q;
  data_->wrenches.begin(channels);
  const VectorXd& force = data_->forces.evaluate(channels, data_->ws, node.q, node.v);
  data_->wrenches.end();
  dynamics::forward_dynamics(data_->model, data_->ws, node.q, node.v, force, node.a);
}

void DenseOutput::begin(const Integrator& integrator, const State& state,
                        const Channels& channels) {
  data_->begun = data_->ended = false;
  set(data_->first, "begin", integrator, state, channels);
  data_->begun = true;
}

void DenseOutput::end(const Integrator& integrator, const State& state, const Channels& channels) {
  data_->ended = false;
  if (!data_->begun || !(state.time_s > data_->first.time_s))
    throw Error(
        ErrorCode::usage,
        formatted("end: the node at {} s given, expected one after that of begin()", state.time_s));
  set(data_->last, "end", integrator, state, channels);
  data_->ended = true;
}

double DenseOutput::begin_s() const noexcept {
  return data_->first.time_s;
}
double DenseOutput::end_s() const noexcept {
  return data_->last.time_s;
}

void DenseOutput::at(double time_s, VectorRef q, VectorRef v) const {
  const Node &a = data_->first, &b = data_->last;
  if (!data_->ended)
    throw Error(ErrorCode::usage, "at: no step yet, expected begin() and end() before");
  if (!(time_s >= a.time_s && time_s <= b.time_s))
    throw Error(ErrorCode::usage, formatted("at: {} s given, expected a time from {} to {} s",
                                            time_s, a.time_s, b.time_s));
  check_size("at", "q", data_->model, q.size());
  check_size("at", "v", data_->model, v.size());
  const double h = b.time_s - a.time_s, s = (time_s - a.time_s) / h;
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const Hermite part = Hermite::quintic(h, a.q[i], a.v[i], a.a[i], b.q[i], b.v[i], b.a[i]);
    q[i] = part.position(s);
    v[i] = part.velocity(s);
  }
}

}  // namespace hamelin::integration
