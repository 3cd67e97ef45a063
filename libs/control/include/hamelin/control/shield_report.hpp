#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace hamelin::control {

/// Why a step is refused: what the arm could touch or pass if it made the step and then stopped.
/// torque: no stop within the torque limits exists after it. answer: there is no usable answer.
enum class StopCause : std::int32_t {
  map,
  unknown_space,
  obstacle,
  self,
  joint_limit,
  velocity_limit,
  torque,
  answer
};
inline constexpr std::size_t stop_causes = 8;
[[nodiscard]] std::string_view to_string(StopCause cause) noexcept;

/// What is proved of the obstacles that move, if the arm falls back on its fail-safe motion.
/// clear: it stays clear of them for MoverCheck::horizon_s, as they are predicted. at_rest: of
/// those of which only the speed is bounded, none touches the arm before it rests, or while it
/// comes nearer to them. none: neither.
enum class MoverProof : std::int32_t { clear, at_rest, none };
inline constexpr std::size_t mover_proofs = 3;
[[nodiscard]] std::string_view to_string(MoverProof proof) noexcept;

/// What a shield counted since the start.
struct ShieldCounts {
  long steps = 0;                          ///< that were asked for
  long refused = 0;                        ///< of them
  long at_rest = 0;                        ///< refused while the arm rested
  long stops = 0;                          ///< runs of refused steps
  long longest = 0;                        ///< the longest of them, in steps
  std::array<long, stop_causes> causes{};  ///< of the stops' beginnings
  double strayed = 0.0;        ///< largest deviation of a joint from a stop's motion [rad or m]
  double strayed_share = 0.0;  ///< the same as a share of the bound that the margins cover
  int strayed_joint = -1;      ///< whose share that is
  /// Stops that went on although the world had changed so that they are not clear any more.
  long overtaken = 0;
  /// Steps with moving obstacles in reach, by what is proved after them.
  std::array<long, mover_proofs> proofs{};
  long evasions = 0;  ///< of the stops, those that were followed by a move when they began
};

/// What a shield did last, and since the start.
struct ShieldReport {
  bool stopping = false;  ///< whether it refused the last step
  bool began = false;     ///< whether that was the first one of a stop
  /// Of the stop in force, which goes on if the next step is refused: whether its motion has ended,
  /// whether it moves on after the arm has stopped, and where it ends, until the next tick.
  bool at_rest = false, evades = false;
  const Eigen::VectorXd* stop_end = nullptr;
  std::optional<StopCause> cause;  ///< of that
  /// What is proved of moving obstacles after the last step; none if there are none in reach.
  std::optional<MoverProof> proof;
  double largest_margin_m = 0.0;  ///< that any stop required of any shape
  ShieldCounts counts;
};

}  // namespace hamelin::control
