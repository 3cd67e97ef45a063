#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "hamelin/description/srdf.hpp"
#include "hamelin/model/robot.hpp"

namespace hamelin::fit {

struct SelfCheckOptions {
  int samples = 10'000;  ///< random configurations within the limits
  std::uint64_t seed = 1;
};

/// Two parts of a robot that move against each other: links, or what was lumped into one or into the base.
struct PartPair {
  std::string part_a, part_b;
  bool neighbours = false;  ///< on bodies that one joint connects, or several with no shapes between
  bool checked = false;     ///< what scene::SelfField looks at; else `reason` says why not
  std::string reason;
  double rest_m = 0.0;   ///< distance of the surfaces at rest [m]; zero or below is contact
  double least_m = 0.0;  ///< least over rest and all samples
  int contacts = 0;      ///< samples in contact

  [[nodiscard]] bool touches_at_rest() const noexcept { return rest_m <= 0.0; }
};

struct SelfCheck {
  std::vector<double> rest_q;  ///< [rad or m]: 0, or the middle of the limits where 0 lies outside
  int samples = 0;
  std::vector<PartPair> pairs;
  std::vector<std::string> shapeless;   ///< moving links that bear no shape, whatever is lumped into them
  std::vector<std::string> odd_limits;  ///< one line each

  /// Pairs that are checked and touch at rest.
  [[nodiscard]] std::vector<PartPair> faults() const;
  /// What a user would list as disabled, as MoveIt's setup assistant does, with the reasons it gives: what is listed
  /// already, neighbours that touch ("Adjacent"), what touches in nearly all samples ("Always") or at rest ("Default");
  /// and, if `never`, what touched in none ("Never"), which no number of samples proves.
  [[nodiscard]] std::vector<description::DisabledPair> disabled(bool never) const;
};

/// The share of samples in contact from which a pair counts as always in contact, as in MoveIt's setup assistant.
inline constexpr double always_share_min = 0.95;

/// "Always" or "Default" (at rest) if a pair's contacts say that its shapes overlap by construction; else empty.
[[nodiscard]] std::string contact_reason(const PartPair& pair, int samples);

/// Distances of all pairs of parts at rest and over random configurations, by the product of exponentials. Joints
/// without limits turn through [−π, π] or slide through [−1, 1] m.
/// @param listed where reasons are taken from for pairs that the robot lists as disabled
[[nodiscard]] SelfCheck check_self(const model::Robot& robot, const std::vector<description::DisabledPair>& listed,
                                   const SelfCheckOptions& options);

/// The text of an SRDF with these pairs.
[[nodiscard]] std::string srdf_text(const std::string& robot, const std::vector<description::DisabledPair>& pairs);

}  // namespace hamelin::fit
