#include "hamelin/dynamics/derivatives.hpp"

#include <algorithm>

#include "derivative_kernels.hpp"
#include "derivative_links.hpp"
#include "hamelin/core/isa_kernels.hpp"
#include "kinematics.hpp"

namespace hamelin::dynamics {

HAMELIN_SELECT_KERNELS(DerivativeKernels, derivative_set)

const DerivativeKernels& derivative_kernels(Isa isa) {
  return select_derivative_set(isa);
}

namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

// The particles of a link about the origin of its joint-aligned frame, from its COM frame.
kernel::DerivativeLink link_of(const model::Link& link, const geometry::SE3& com) {
  const Matrix3d inertia = com.R() * link.inertia_kg_m2 * com.R().transpose();
  Matrix3d second = link.mass_kg * com.p() * com.p().transpose() - inertia;
  second.diagonal().array() += 0.5 * inertia.trace();
  return {link.mass_kg,
          link.joint.armature,
          vec3(link.mass_kg * com.p()),
          {second(0, 0), second(0, 1), second(0, 2), second(1, 1), second(1, 2), second(2, 2)},
          link.joint.type == model::JointType::prismatic};
}

void place_frames(const Model& model, DerivativesWorkspace& ws, const ConstVectorRef& q) {
  forward_kinematics(model, ws.ws, q);
  const Vector3d origin = model.base().p();
  for (std::size_t i = 0; i < ws.frames.size(); ++i) {
    const Workspace::Frame& f = ws.ws.frames[i];
    ws.frames[i] = {
        {vec3(f.R.col(0)), vec3(f.R.col(1)), vec3(f.R.col(2)), vec3(f.p - origin), vec3(f.axis)}};
  }
}

// The kernels' matrices, one after the other.
struct Matrices {
  explicit Matrices(DerivativesWorkspace& ws)
      : n(ws.ws.owner.dof),
        ld(static_cast<Index>(ws.kernels->leading(static_cast<std::size_t>(n)))),
        first(static_cast<double*>(ws.matrices.get())) {}
  [[nodiscard]] double* at(Index k) const { return first + k * ld * n; }
  void copy(Index k, MatrixRef out) const {
    out = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>(at(k), n, n,
                                                                     Eigen::OuterStride<>(ld));
  }
  Index n, ld;
  double* first;
};

void compute(const Model& model, DerivativesWorkspace& ws, const Matrices& out,
             const ConstVectorRef& q, const ConstVectorRef& v, const ConstVectorRef& a) {
  place_frames(model, ws, q);
  ws.kernels->inverse_dynamics(ws.links.size(), ws.sweep.get(), ws.links.data(), ws.frames.data(),
                               vec3(model.gravity()), v.data(), a.data(), out.at(0), out.at(1),
                               out.at(2));
}

void check_square(const detail::Call& call, Index n, const char* rows, const char* columns,
                  const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  call.size(rows, matrix.rows(), n).size(columns, matrix.cols(), n);
}

void check(const detail::Call& call, const KineticDerivatives& out, Index n) {
  call.size("kinetic", out.p.size(), n).size("kinetic.dK_dq", out.dK_dq.size(), n);
  check_square(call, n, "kinetic.M (rows)", "kinetic.M (columns)", out.M);
  check_square(call, n, "kinetic.dp_dq (rows)", "kinetic.dp_dq (columns)", out.dp_dq);
  check_square(call, n, "kinetic.d2K_dq2 (rows)", "kinetic.d2K_dq2 (columns)", out.d2K_dq2);
}
void check(const detail::Call& call, const PotentialDerivatives& out, Index n) {
  call.size("potential", out.dU_dq.size(), n);
  check_square(call, n, "potential.d2U_dq2 (rows)", "potential.d2U_dq2 (columns)", out.d2U_dq2);
}

// After place_frames().
void compute(DerivativesWorkspace& ws, const ConstVectorRef& v, KineticDerivatives& out) {
  const Matrices matrices(ws);
  ws.kernels->kinetic(
      ws.links.size(), ws.sweep.get(), ws.links.data(), ws.frames.data(), v.data(),
      {out.p.data(), out.dK_dq.data(), matrices.at(0), matrices.at(1), matrices.at(2)});
  matrices.copy(0, out.M);
  matrices.copy(1, out.dp_dq);
  matrices.copy(2, out.d2K_dq2);
}
void compute(const Model& model, DerivativesWorkspace& ws, PotentialDerivatives& out) {
  const Matrices matrices(ws);
  ws.kernels->potential(ws.links.size(), ws.sweep.get(), ws.links.data(), ws.frames.data(),
                        vec3(model.gravity()), {out.dU_dq.data(), matrices.at(0)});
  matrices.copy(0, out.d2U_dq2);
}

}  // namespace

std::vector<kernel::DerivativeLink> derivative_links(const Model& model) {
  std::vector<kernel::DerivativeLink> links;
  links.reserve(static_cast<std::size_t>(model.dof()));
  for (int i = 0; i < model.dof(); ++i)
    links.push_back(
        link_of(model.robot().links[static_cast<std::size_t>(i)], model.com_in_frame(i)));
  return links;
}

KineticDerivatives::KineticDerivatives(Index dof)
    : p(VectorXd::Zero(dof)), dK_dq(p), M(Eigen::MatrixXd::Zero(dof, dof)), dp_dq(M), d2K_dq2(M) {}

PotentialDerivatives::PotentialDerivatives(Index dof)
    : dU_dq(VectorXd::Zero(dof)), d2U_dq2(Eigen::MatrixXd::Zero(dof, dof)) {}

DerivativesWorkspace::DerivativesWorkspace(const model::Model& model, Isa isa)
    : ws(model, isa),
      kernels(&derivative_kernels(isa)),
      sweep(kernels->bytes(static_cast<std::size_t>(model.dof()))),
      matrices(5 * kernels->leading(static_cast<std::size_t>(model.dof())) *
               static_cast<std::size_t>(model.dof()) * sizeof(double)),
      external(model.dof(), model.dof()),
      links(derivative_links(model)),
      frames(static_cast<std::size_t>(model.dof())) {
  // what packets read beyond the last joint must be finite
  const auto n = static_cast<std::size_t>(model.dof());
  std::fill_n(static_cast<std::byte*>(sweep.get()), kernels->bytes(n), std::byte{});
  std::fill_n(static_cast<double*>(matrices.get()), 5 * kernels->leading(n) * n, 0.0);
}

DerivativesWorkspace::~DerivativesWorkspace() = default;

void inverse_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& a, MatrixRef dtau_dq, MatrixRef dtau_dv,
                                  MatrixRef dtau_da) {
  const detail::Call call("inverse_dynamics_derivatives", model, ws.ws.owner);
  const Index n = ws.ws.owner.dof;
  call.joints("q", q).joints("v", v).joints("a", a);
  check_square(call, n, "dtau_dq (rows)", "dtau_dq (columns)", dtau_dq);
  check_square(call, n, "dtau_dv (rows)", "dtau_dv (columns)", dtau_dv);
  check_square(call, n, "dtau_da (rows)", "dtau_da (columns)", dtau_da);
  const Matrices out(ws);
  compute(model, ws, out, q, v, a);
  out.copy(0, dtau_dq);
  out.copy(1, dtau_dv);
  out.copy(2, dtau_da);
}

// docs/theory.md (2.29)
void forward_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& tau, VectorRef a, MatrixRef da_dq,
                                  MatrixRef da_dv, MatrixRef da_dtau) {
  const detail::Call call("forward_dynamics_derivatives", model, ws.ws.owner);
  const Index n = ws.ws.owner.dof;
  call.joints("q", q).joints("v", v).joints("tau", tau).joints("a", a);
  check_square(call, n, "da_dq (rows)", "da_dq (columns)", da_dq);
  check_square(call, n, "da_dv (rows)", "da_dv (columns)", da_dv);
  check_square(call, n, "da_dtau (rows)", "da_dtau (columns)", da_dtau);
  VectorXd& acceleration = ws.ws.column_out;  // a may share memory with q and v
  detail::forward_dynamics(model, ws.ws, q.data(), v.data(), tau.data(), acceleration.data());
  const Matrices out(ws);
  compute(model, ws, out, q, v, acceleration);
  ws.kernels->forward_dynamics(ws.links.size(), out.at(0), out.at(1), out.at(2), out.at(3),
                               out.at(4));
  a = acceleration;
  out.copy(3, da_dq);
  out.copy(4, da_dv);
  out.copy(2, da_dtau);
}

void kinetic_derivatives(const Model& model, DerivativesWorkspace& ws, const ConstVectorRef& q,
                         const ConstVectorRef& v, KineticDerivatives& out) {
  const detail::Call call("kinetic_derivatives", model, ws.ws.owner);
  call.joints("q", q).joints("v", v);
  check(call, out, ws.ws.owner.dof);
  place_frames(model, ws, q);
  compute(ws, v, out);
}

void potential_derivatives(const Model& model, DerivativesWorkspace& ws, const ConstVectorRef& q,
                           PotentialDerivatives& out) {
  const detail::Call call("potential_derivatives", model, ws.ws.owner);
  call.joints("q", q);
  check(call, out, ws.ws.owner.dof);
  place_frames(model, ws, q);
  compute(model, ws, out);
}

void energy_derivatives(const Model& model, DerivativesWorkspace& ws, const ConstVectorRef& q,
                        const ConstVectorRef& v, KineticDerivatives& kinetic,
                        PotentialDerivatives& potential) {
  const detail::Call call("energy_derivatives", model, ws.ws.owner);
  call.joints("q", q).joints("v", v);
  check(call, kinetic, ws.ws.owner.dof);
  check(call, potential, ws.ws.owner.dof);
  place_frames(model, ws, q);
  compute(ws, v, kinetic);
  compute(model, ws, potential);
}

}  // namespace hamelin::dynamics
