#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "hamelin/description/srdf.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/model/robot.hpp"

namespace hamelin::fit {

struct SelfCheckOptions {
  int samples = 10'000;  ///< random configurations within the limits
  std::uint64_t seed = 1;
};

/// Two parts of a robot that move relative to each other: links, or bodies lumped into a link or
/// into the base.
struct PartPair {
  std::string part_a, part_b;
  bool neighbours = false;  ///< no shapes on the bodies between theirs in the chain
  bool checked = false;     ///< whether scene::SelfField checks it; if not, `reason` says why
  std::string reason;
  double rest_m = 0.0;   ///< distance of the surfaces at rest [m]; zero or negative: contact
  double least_m = 0.0;  ///< smallest distance at rest and in all samples [m]
  int contacts = 0;      ///< samples in contact

  [[nodiscard]] bool touches_at_rest() const noexcept { return rest_m <= 0.0; }
};

struct SelfCheck {
  std::vector<double> rest_q;  ///< [rad or m]: 0, or the middle of the limits if 0 lies outside
  int samples = 0;
  std::vector<PartPair> pairs;
  std::vector<std::string> links_without_shapes;  ///< moving links, lumped bodies included
  std::vector<std::string> suspicious_limits;     ///< one line per finding

  /// Pairs that are checked and touch at rest.
  [[nodiscard]] std::vector<PartPair> contacts_at_rest() const;
  /// The pairs that MoveIt's setup assistant would list as disabled, with its reasons: pairs listed
  /// already, neighbours that touch ("Adjacent"), pairs that touch in nearly all samples ("Always")
  /// or at rest ("Default"). With `never` also pairs that touched in no sample ("Never"), although
  /// no number of samples proves that they never do.
  [[nodiscard]] std::vector<description::DisabledPair> disabled(bool never) const;
};

/// Least share of samples in contact with which a pair counts as always in contact, as in MoveIt's
/// setup assistant.
inline constexpr double always_share_min = 0.95;

/// "Always" or "Default" (contact at rest) if the shapes of a pair overlap by construction; else
/// empty.
[[nodiscard]] std::string contact_reason(const PartPair& pair, int samples);

/// Distances of all pairs of parts at rest and in random configurations. Parts are placed by the
/// product of exponentials. A joint without limits is sampled over [−π, π] if revolute, [−1, 1] m
/// if prismatic.
/// @param listed gives the reasons of pairs that the robot lists as disabled
[[nodiscard]] SelfCheck check_self(const model::Robot& robot,
                                   const std::vector<description::DisabledPair>& listed,
                                   const SelfCheckOptions& options);

/// The text of an SRDF file that lists these pairs.
[[nodiscard]] std::string srdf_text(const std::string& robot,
                                    const std::vector<description::DisabledPair>& pairs);

/// What `hamelin robot check --json` prints.
[[nodiscard]] Json to_json(const SelfCheck& check, const model::Robot& robot);

}  // namespace hamelin::fit
