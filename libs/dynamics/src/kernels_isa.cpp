// Compiled once per instruction set; kernel/lanes.hpp explains which functions may be used here.
#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"
#include "kernels.hpp"

namespace hamelin::dynamics {
namespace HAMELIN_ISA_NAMESPACE {

namespace {

using Pack = kernel::Lanes<kernel::native_lanes>;

// The sweeps as plain functions. Each call lays out its scratch in the caller's memory.
template <template <class> class Group>
struct Entry {
  using Space = Group<double>;
  using Packed = Group<Pack>;
  using Chain = typename Space::Chain;
  using Scratch = kernel::Scratch<Space>;

  static Scratch scratch(const Chain& chain, void* memory) noexcept {
    return Scratch::at(memory, kernel::count<Space>(chain));
  }
  static void inverse_dynamics(const Chain& c, void* m, const double* q, const double* v,
                               const double* a, double* tau) noexcept {
    kernel::inverse_dynamics<Space>(c, scratch(c, m), q, v, a, tau);
  }
  static void forward_dynamics(const Chain& c, void* m, const double* q, const double* v,
                               const double* tau, double* a) noexcept {
    kernel::forward_dynamics<Space>(c, scratch(c, m), q, v, tau, a);
  }
  static void gravity_torque(const Chain& c, void* m, const double* q, double* tau) noexcept {
    kernel::gravity_torque<Space>(c, scratch(c, m), q, tau);
  }
  static void solve_mass(const Chain& c, void* m, const double* q, const double* y,
                         double* x) noexcept {
    kernel::solve_mass<Space>(c, scratch(c, m), q, y, x);
  }
  static void factor(const Chain& c, void* m, const double* q) noexcept {
    kernel::place<Space>(c, scratch(c, m), q);
    kernel::factor<Space>(c, scratch(c, m));
  }
  static void solve_factored(const Chain& c, void* m, const double* y, double* x) noexcept {
    kernel::solve_factored<Space>(c, scratch(c, m), y, x);
  }
  static void momentum(const Chain& c, void* m, const double* q, const double* v,
                       double* p) noexcept {
    kernel::momentum<Space>(c, scratch(c, m), q, v, p);
  }
  static double kinetic_energy(const Chain& c, void* m, const double* q, const double* v) noexcept {
    return kernel::kinetic_energy<Space>(c, scratch(c, m), q, v);
  }
  static double potential_energy(const Chain& c, void* m, const double* q) noexcept {
    return kernel::potential_energy<Space>(c, scratch(c, m), q);
  }
  static void mass_matrix(const Chain& c, void* m, const double* q, double* M,
                          std::size_t ld) noexcept {
    kernel::mass_matrix<Space>(c, scratch(c, m), q, M, ld);
  }

  // The joint vectors of a packet are copied to memory next to its scratch, where they have no
  // stride.
  static std::size_t batch_bytes(std::size_t n) noexcept {
    return kernel::Scratch<Packed>::bytes(n) + 4 * n * sizeof(Pack);
  }
  template <class Sweep>
  static void batch(const Chain& chain, void* memory, std::size_t states, std::size_t stride,
                    const double* q, const double* v, const double* in, double* out,
                    Sweep sweep) noexcept {
    constexpr auto lanes = static_cast<std::size_t>(kernel::native_lanes);
    const std::size_t n = kernel::count<Space>(chain);
    Pack* const vectors = static_cast<Pack*>(memory);
    const auto k = kernel::Scratch<Packed>::at(vectors + 4 * n, n);
    const double* const from[] = {q, v, in};
    for (std::size_t first = 0; first < states; first += lanes) {
      const std::size_t count = states - first < lanes ? states - first : lanes;
      for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t i = 0; i < n; ++i) {
          const double* const row = from[j] + i * stride + first;
          if (count == lanes) {
            vectors[j * n + i] = Pack::load(row);
          } else {  // unused lanes of the last packet repeat its first state
            for (std::size_t lane = 0; lane < lanes; ++lane)
              vectors[j * n + i].v[lane] = row[lane < count ? lane : 0];
          }
        }
      }
      sweep(chain, k, vectors, vectors + n, vectors + 2 * n, vectors + 3 * n);
      for (std::size_t i = 0; i < n; ++i) {
        double* const row = out + i * stride + first;
        if (count == lanes)
          vectors[3 * n + i].store(row);
        else
          for (std::size_t lane = 0; lane < count; ++lane) row[lane] = vectors[3 * n + i].v[lane];
      }
    }
  }
  static void inverse_dynamics_batch(const Chain& c, void* m, std::size_t states,
                                     std::size_t stride, const double* q, const double* v,
                                     const double* a, double* tau) noexcept {
    batch(c, m, states, stride, q, v, a, tau, kernel::inverse_dynamics<Packed>);
  }
  static void forward_dynamics_batch(const Chain& c, void* m, std::size_t states,
                                     std::size_t stride, const double* q, const double* v,
                                     const double* tau, double* a) noexcept {
    batch(c, m, states, stride, q, v, tau, a, kernel::forward_dynamics<Packed>);
  }

  static constexpr Kernels<Chain> table{Scratch::bytes,
                                        inverse_dynamics,
                                        forward_dynamics,
                                        gravity_torque,
                                        solve_mass,
                                        factor,
                                        solve_factored,
                                        momentum,
                                        kinetic_energy,
                                        potential_energy,
                                        mass_matrix,
                                        static_cast<std::size_t>(kernel::native_lanes),
                                        batch_bytes,
                                        inverse_dynamics_batch,
                                        forward_dynamics_batch};
};

}  // namespace

extern const KernelSet set;
constexpr KernelSet set{{Entry<kernel::SpatialPlain>::table, Entry<kernel::SpatialMixed>::table,
                         Entry<kernel::PlanarPlain>::table, Entry<kernel::PlanarMixed>::table}};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics
