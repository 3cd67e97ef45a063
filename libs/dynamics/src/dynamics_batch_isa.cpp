// Compiled once per instruction set; kernel/lanes.hpp explains which functions may be used here.
#include "batch_lanes.hpp"
#include "dynamics_batch_kernel.hpp"
#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "hamelin/dynamics/kernel/state_derivatives.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"

namespace hamelin::dynamics {
namespace HAMELIN_ISA_NAMESPACE {

namespace {

using Pack = BatchPack;

// Scratch memory of a packet of states.
struct Packet {
  Pack *q, *v, *x, *a;           // joint vectors
  Pack *by_q, *by_v, *by_third;  // matrices
  void *derivatives, *sweep;

  static std::size_t bytes(std::size_t n) noexcept {
    return (4 * n + 3 * n * n) * sizeof(Pack) + kernel::StateDerivativeScratch<Pack>::bytes(n);
  }
  static Packet at(void* memory, std::size_t n) noexcept {
    Pack* const vectors = static_cast<Pack*>(memory);
    Pack* const matrices = vectors + 4 * n;
    Pack* const rest = matrices + 3 * n * n;
    return {vectors,
            vectors + n,
            vectors + 2 * n,
            vectors + 3 * n,
            matrices,
            matrices + n * n,
            matrices + 2 * n * n,
            rest,
            reinterpret_cast<char*>(rest) + kernel::StateDerivativeScratch<Pack>::bytes(n)};
  }
};

// Calls f(PacketRows of the arguments, of the results) for all packets.
template <class F>
HAMELIN_INLINE void for_packets(const DynamicsBatchCall& call, F&& f) noexcept {
  for (std::size_t first = 0; first < call.states; first += batch_lanes)
    f(PacketRows(call.states, call.stride, first),
      PacketRows(call.states, call.result_stride, first));
}

// The outward sweep at the states of a packet.
void sweep_outwards(const DynamicsBatchModel& model,
                    const kernel::StateDerivativeScratch<Pack>& scratch, const Pack* q,
                    const Pack* v, const Pack* a) noexcept {
  LanePose pose = same_in_lanes(model.root);
  kernel::sweep_outwards(
      scratch, model.bodies,
      [&](std::size_t i) {
        pose = advance(model.links[i], q[i], pose);
        return kernel::PlacedFrame<Pack>{pose.x, pose.y, pose.z, pose.p,
                                         axis_of(model.links[i], pose)};
      },
      model.gravity, v, a);
}

void inverse_dynamics_derivatives(const DynamicsBatchCall& call) noexcept {
  const std::size_t n = call.model->dof;
  const Packet packet = Packet::at(call.memory, n);
  const auto scratch = kernel::StateDerivativeScratch<Pack>::at(packet.derivatives, n);
  double* const matrices[] = {call.by_q, call.by_v, call.by_third};
  for_packets(call, [&](const PacketRows& in, const PacketRows& out) {
    in.load(call.q, n, packet.q);
    in.load(call.v, n, packet.v);
    in.load(call.x, n, packet.x);
    sweep_outwards(*call.model, scratch, packet.q, packet.v, packet.x);
    kernel::sweep_inwards(scratch, call.model->bodies,
                          [&](std::size_t matrix, std::size_t i, std::size_t j, Pack number) {
                            out.store(matrices[matrix], i + j * n, number);
                          });
  });
}

// From packet.a, the accelerations at q, v and the torques.
void store_forward_derivatives(const DynamicsBatchCall& call, const Packet& packet,
                               const PacketRows& out) noexcept {
  const std::size_t n = call.model->dof;
  const auto scratch = kernel::StateDerivativeScratch<Pack>::at(packet.derivatives, n);
  sweep_outwards(*call.model, scratch, packet.q, packet.v, packet.a);
  Pack* const matrices[] = {packet.by_q, packet.by_v, packet.by_third};
  kernel::sweep_inwards(scratch, call.model->bodies,
                        [&](std::size_t matrix, std::size_t i, std::size_t j, Pack number) {
                          matrices[matrix][i + j * n] = number;
                        });
  kernel::invert_symmetric(n, packet.by_third, packet.x);
  double* const results[] = {call.by_q, call.by_v};
  kernel::minus_products(n, packet.by_third, packet.by_q, packet.by_v,
                         [&](std::size_t matrix, std::size_t i, std::size_t j, Pack number) {
                           out.store(results[matrix], i + j * n, number);
                         });
  for (std::size_t row = 0; row < n * n; ++row) out.store(call.by_third, row, packet.by_third[row]);
  for (std::size_t i = 0; i < n; ++i) out.store(call.acceleration, i, packet.a[i]);
}

template <template <class> class Group>
struct BatchEntry {
  using Packed = Group<Pack>;
  using Chain = typename Packed::Chain;
  using Scratch = kernel::Scratch<Packed>;

  static std::size_t bytes(std::size_t n) noexcept { return Packet::bytes(n) + Scratch::bytes(n); }
  static void mass_matrix(const Chain& chain, const DynamicsBatchCall& call) noexcept {
    const std::size_t n = call.model->dof;
    const Packet packet = Packet::at(call.memory, n);
    const Scratch scratch = Scratch::at(packet.sweep, n);
    for_packets(call, [&](const PacketRows& in, const PacketRows& out) {
      in.load(call.q, n, packet.q);
      kernel::mass_matrix<Packed>(chain, scratch, packet.q, packet.by_third, n);
      for (std::size_t row = 0; row < n * n; ++row)
        out.store(call.by_third, row, packet.by_third[row]);
    });
  }
  static void forward_dynamics_derivatives(const Chain& chain,
                                           const DynamicsBatchCall& call) noexcept {
    const std::size_t n = call.model->dof;
    const Packet packet = Packet::at(call.memory, n);
    const Scratch scratch = Scratch::at(packet.sweep, n);
    for_packets(call, [&](const PacketRows& in, const PacketRows& out) {
      in.load(call.q, n, packet.q);
      in.load(call.v, n, packet.v);
      in.load(call.x, n, packet.x);
      kernel::forward_dynamics<Packed>(chain, scratch, packet.q, packet.v, packet.x, packet.a);
      store_forward_derivatives(call, packet, out);
    });
  }
  static constexpr DynamicsBatchKernels<Chain> table{bytes, mass_matrix,
                                                     forward_dynamics_derivatives};
};

}  // namespace

extern const DynamicsBatchSet dynamics_batch_set;
constexpr DynamicsBatchSet dynamics_batch_set{
    {BatchEntry<kernel::SpatialPlain>::table, BatchEntry<kernel::SpatialMixed>::table,
     BatchEntry<kernel::PlanarPlain>::table, BatchEntry<kernel::PlanarMixed>::table},
    inverse_dynamics_derivatives};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics
