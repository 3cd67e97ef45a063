#pragma once
#include <cstdint>

#include "chain.hpp"

namespace hamelin::search::kernel {

/// What more than this of anything has is checked exactly.
inline constexpr int parts_max = 64, spheres_max = 512, pairs_max = 256, primitives_max = 64,
                     places_max = 32;
inline constexpr int sphere_words = spheres_max / 64, pair_words = pairs_max / 64;

// All lengths are in metres, in single precision, and all points in the frame of the check, see
// LineCheck, unless stated otherwise.

/// A sphere that holds a shape or a piece of one, in the frame of its link.
struct Sphere {
  float center[3];
  float radius;  ///< holds the shape
  float inner;   ///< is held by the shape
};

/// Spheres that move as one, one after the other in Arm::spheres.
struct Part {
  int link;  ///< −1: fixed
  int first, count;
  Sphere ball;   ///< holds all spheres
  float spread;  ///< largest distance of the centres from the ball's centre
};

struct Pair {
  int part_a, part_b;
};

struct Arm {
  Chain chain;
  int part_count, pair_count;
  const Part* parts;  ///< those that move come first, from the tip to the base
  const Sphere* spheres;
  const Pair* pairs;
};

/// An obstacle: a box with rounded edges, or a cylinder about its local z.
struct Primitive {
  float center[3];
  float axes[3][3];  ///< the local axes
  float half[3];     ///< half edges; of a cylinder its radius first, and half its length last
  float radius;      ///< by which it is rounded
  float ball;        ///< radius of a ball about the centre that holds it
  float slack;       ///< bound of rounding, docs/theory.md (17.16)
  bool cylinder;
};

/// A scene::DistanceField::View; node = position · inverse + offset.
struct Field {
  const std::uint16_t* values;
  int count[3];  ///< zero if there is none
  float inverse, offset[3], resolution, unit;
};

struct World {
  Field field;
  const Primitive* primitives;
  int primitive_count;
  float map_slack, pair_slack;  ///< bounds of rounding, docs/theory.md (17.15), (17.16)
};

/// A place of search::Margins, relative to the start of the line.
struct Place {
  float apart[joints_max];  ///< weighted, start less place
  float margin, near, inverse_range;
};

struct Line {
  float start[joints_max], step[joints_max];  ///< angle of the frame or position, and its change
  float kappa[parts_max];                     ///< bounds of (12.5)
  float way[pairs_max];                       ///< Σ L |Δq|, (17.4)
  float speed_slack;                          ///< bound of the rounding of |p'|, (17.14)
  float full_margin, self_most;               ///< the latter of pairs
  float weighted_step[joints_max], weighted_length, distance_slack;
  int place_count;
  Place places[places_max];
};

/// What is not proved of a piece.
struct Open {
  float s, width;  ///< middle and width of the piece
  float margin;    ///< largest on the piece
  std::uint64_t spheres[sphere_words], pairs[pair_words];
};

/// Sixteen pieces of a line. Either all of them are to be proved completely, or every four are a
/// quarter each of a piece, for what is open there.
struct Batch {
  alignas(64) float s[lanes];  ///< middles
  float width;
  unsigned active;        ///< bits of the lanes in use
  const Open* pieces[4];  ///< null: everything
};

struct Hot {
  int part, sphere;  ///< −1: none
};

/// Exact distance of a point from the map, or `limit` if that is less.
using ExactDistance = double (*)(void* context, int sphere, const float* p, double limit);

/// Working memory.
struct Scratch {
  static constexpr int pose_floats = 18 * lanes;
  alignas(64) float poses[joints_max][pose_floats];
  alignas(64) float centers[spheres_max][3 * lanes];
  long placed[parts_max];  ///< the batch for which the centres of a part are valid
  long batch;
  static constexpr int hot_count = 3;
  Hot hot[hot_count];  ///< what rejected motions lately
  ExactDistance exact;
  void* context;
  Open open[lanes];  ///< the answer: what remains open
  int open_count;
};

struct LineKernels {
  /// Proves pieces of a line: docs/theory.md (17.10)–(17.12).
  /// @return false if a posture does not keep its margin; otherwise what is not proved is in
  ///         scratch.open
  bool (*check)(const Arm& arm, const World& world, const Line& line, const Batch& batch,
                Scratch& scratch) noexcept;
  /// Sine and cosine of 16 numbers, for tests.
  void (*sincos)(const float* x, float* sine, float* cosine) noexcept;
};

}  // namespace hamelin::search::kernel
