#include "state_owner.hpp"

#include <bit>

#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin::integration {

namespace {

// StateOwner::scheme: the number of the scheme from 1, its order if there are several, whether
// gauss is in its structure mode, and alpha of hamel in single precision.
constexpr unsigned order_at = 8, structure_at = 16, alpha_at = 32;
constexpr std::uint64_t one_byte = 0xff;

std::uint64_t details_of(const HamelOptions& o) {
  // + 0: −0 is 0
  return std::uint64_t{std::bit_cast<std::uint32_t>(static_cast<float>(o.alpha) + 0.0F)}
         << alpha_at;
}
std::uint64_t details_of(const GaussOptions& o) {
  return static_cast<std::uint64_t>(o.order) << order_at | std::uint64_t{structure_mode(o)}
                                                               << structure_at;
}
std::uint64_t details_of(const CompositionOptions& o) {
  return static_cast<std::uint64_t>(o.order) << order_at;
}
template <class O>
std::uint64_t details_of(const O&) {
  return 0;
}

std::size_t scheme_index(std::uint64_t scheme) {
  return static_cast<std::size_t>((scheme & one_byte) - 1);
}

std::string describe_scheme(std::uint64_t scheme) {
  const std::size_t index = scheme_index(scheme);
  std::string text = integrator_names()[index];
  if (const std::uint64_t order = scheme >> order_at & one_byte; order > 0)
    text += formatted(":{}", order);
  const Options defaults = make_options(integrator_names()[index]);
  if (std::holds_alternative<GaussOptions>(defaults))
    text += (scheme >> structure_at & 1) != 0 ? " (structure)" : " (accurate)";
  if (std::holds_alternative<HamelOptions>(defaults))
    text += formatted(" (alpha {:.6g})",
                      std::bit_cast<float>(static_cast<std::uint32_t>(scheme >> alpha_at)));
  return text;
}

}  // namespace

StateOwner owner_of_states(const Model& model, const Options& options) {
  const std::uint64_t details = std::visit([](const auto& o) { return details_of(o); }, options);
  return {(options.index() + 1) | details, model.fingerprint()};
}

void refuse_owner(const char* function, const State& state, const StateOwner& expected,
                  const Model& model) {
  const std::string wanted = describe_scheme(expected.scheme);
  const std::uint64_t given = state.owner.scheme;
  if (given == 0 || scheme_index(given) >= integrator_names().size())
    throw Error(ErrorCode::usage, formatted("{}: state: made by no integrator, expected a state "
                                            "from start() of {}",
                                            function, wanted));
  if (given != expected.scheme)
    throw Error(ErrorCode::usage, formatted("{}: state: belongs to {}, expected a state of {}",
                                            function, describe_scheme(given), wanted));
  throw Error(ErrorCode::usage,
              formatted("{}: state: belongs to another model (of {} joints), expected a state of "
                        "this '{}' (of {} joints) or of an equal model",
                        function, state.q.size(), model.robot().name, model.dof()));
}

}  // namespace hamelin::integration
