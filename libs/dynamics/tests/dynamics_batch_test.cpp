#include "hamelin/dynamics/dynamics_batch.hpp"

#include <Eigen/Dense>
#include <array>
#include <catch2/catch.hpp>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/frame_batch.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/exact_derivatives.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::Index;
using Eigen::MatrixXd;

namespace {

// Blocks of matrices with one row stride, which is `spare` numbers longer than a row. What lies
// beyond the rows must not change.
class BatchMemory {
 public:
  BatchMemory(Index rows, Index states, Index spare)
      : all_(StatesXd::Constant(rows, states + spare, untouched)), states_(states) {}
  [[nodiscard]] auto block() { return all_.leftCols(states_); }
  [[nodiscard]] bool is_untouched_beyond() const {
    return (all_.rightCols(all_.cols() - states_).array() == untouched).all();
  }

 private:
  static constexpr double untouched = 12345.0;
  StatesXd all_;
  Index states_;
};

// The arguments and results of all three calls.
struct BatchCalls {
  BatchCalls(Index n, Index states, Index spare, Rng& rng)
      : q(n, states, spare),
        v(n, states, spare),
        x(n, states, spare),
        a(n, states, spare),
        M(n * n, states, spare),
        inverse{BatchMemory(n * n, states, spare), BatchMemory(n * n, states, spare),
                BatchMemory(n * n, states, spare)},
        forward(inverse) {
    for (auto* each : {&q, &v, &x})
      for (Index s = 0; s < states; ++s)
        each->block().col(s) = test::random_joints(rng, static_cast<int>(n), 3.0);
  }
  void run(DynamicsBatch& batch) {
    batch.mass_matrix(q.block(), M.block());
    batch.inverse_dynamics_derivatives(q.block(), v.block(), x.block(), inverse[0].block(),
                                       inverse[1].block(), inverse[2].block());
    batch.forward_dynamics_derivatives(q.block(), v.block(), x.block(), a.block(),
                                       forward[0].block(), forward[1].block(), forward[2].block());
  }
  [[nodiscard]] std::vector<BatchMemory*> results() {
    return {&M, &inverse[0], &inverse[1], &inverse[2], &forward[0], &forward[1], &forward[2], &a};
  }
  [[nodiscard]] bool equals(BatchCalls& other, Index first, Index states) {
    const auto mine = results(), others = other.results();
    for (std::size_t i = 0; i < mine.size(); ++i)
      if (mine[i]->block().middleCols(first, states) !=
          others[i]->block().middleCols(first, states))
        return false;
    return true;
  }
  BatchMemory q, v, x, a, M;
  std::array<BatchMemory, 3> inverse, forward;
};

MatrixXd matrix_of(BatchMemory& memory, Index n, Index state) {
  const VectorXd entries = memory.block().col(state);
  return Eigen::Map<const MatrixXd>(entries.data(), n, n);
}

// The largest difference from a call of one state, of the size of its results.
double worst_difference(const Model& model, BatchCalls& calls) {
  const Index n = model.dof();
  DerivativesWorkspace ws(model);
  MatrixXd M(n, n), by_q(n, n), by_v(n, n), by_x(n, n);
  VectorXd a(n);
  double worst = 0.0;
  const auto compare = [&](const MatrixXd& found, const MatrixXd& expected, double size) {
    worst = std::max(worst, (found - expected).norm() / std::max(expected.norm(), size));
  };
  for (Index s = 0; s < calls.q.block().cols(); ++s) {
    const VectorXd q = calls.q.block().col(s), v = calls.v.block().col(s),
                   x = calls.x.block().col(s);
    mass_matrix(model, ws.ws, q, M);
    compare(matrix_of(calls.M, n, s), M, 0.0);
    inverse_dynamics_derivatives(model, ws, q, v, x, by_q, by_v, by_x);
    const double size = 1e-2 * M.norm();  // one joint has no Coriolis torque, only rounding
    compare(matrix_of(calls.inverse[0], n, s), by_q, size);
    compare(matrix_of(calls.inverse[1], n, s), by_v, size);
    compare(matrix_of(calls.inverse[2], n, s), by_x, size);
    forward_dynamics_derivatives(model, ws, q, v, x, a, by_q, by_v, by_x);
    // what is solved for has errors that grow with the condition of M
    const double grown = 1.0 + 1e-3 * M.norm() * by_x.norm(), small = 1e-2 * by_x.norm();
    const auto compare_solved = [&](const MatrixXd& found, const MatrixXd& expected) {
      worst = std::max(worst, (found - expected).norm() / std::max(expected.norm(), small) / grown);
    };
    compare_solved(matrix_of(calls.forward[0], n, s), by_q);
    compare_solved(matrix_of(calls.forward[1], n, s), by_v);
    compare_solved(matrix_of(calls.forward[2], n, s), by_x);
    compare_solved(calls.a.block().col(s), a);
  }
  return worst;
}

struct BatchChain {
  std::uint64_t seed;
  int n, prismatic_every;
  bool planar, rotors;
};

Model random_model(const BatchChain& c) {
  model::Robot robot = test::random_robot(c.seed, c.n, c.prismatic_every, c.planar);
  if (c.rotors)
    for (std::size_t i = 0; i < robot.links.size(); i += 2) robot.links[i].joint.armature = 0.1;
  Rng rng(c.seed + 7);
  const geometry::SE3 base{test::random_rotation(rng), test::random_vector(rng)};
  return Model(std::move(robot), base, Eigen::Vector3d{1.0, -2.0, -9.0});
}

std::vector<Isa> batch_sets() {
  std::vector<Isa> sets;
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4})
    if (is_available(isa)) sets.push_back(isa);
  return sets;
}

void check_batches(const Model& model, int states, std::uint64_t seed) {
  for (const Isa isa : batch_sets()) {
    CAPTURE(model.robot().name, states, name_of(isa));
    Rng rng(seed);
    BatchCalls calls(model.dof(), states, states % 3, rng);  // odd strides, too
    DynamicsBatch batch(model, {.isa = isa});
    calls.run(batch);
    CHECK(worst_difference(model, calls) <= 1e-12);
    for (auto* result : calls.results()) CHECK(result->is_untouched_beyond());
    if (isa != default_isa()) continue;  // threads share states the same way on every set
    for (const int threads : {2, 5}) {
      rng = Rng(seed);
      BatchCalls shared(model.dof(), states, states % 3, rng);
      DynamicsBatch sharing(model, {.isa = isa, .threads = threads});
      shared.run(sharing);
      CHECK(shared.equals(calls, 0, states));
    }
  }
}

}  // namespace

TEST_CASE("matrices at many states are those at one, for random chains", "[dynamics][batch]") {
  const auto c = GENERATE(BatchChain{1, 1, 0, false, false}, BatchChain{2, 1, 1, false, true},
                          BatchChain{3, 7, 0, false, false}, BatchChain{4, 6, 2, false, true},
                          BatchChain{5, 5, 1, false, false}, BatchChain{6, 4, 0, true, false},
                          BatchChain{7, 6, 3, true, true}, BatchChain{8, 2, 2, true, false},
                          BatchChain{9, 12, 4, false, true}, BatchChain{10, 30, 5, false, false},
                          BatchChain{11, 30, 0, true, true});
  const Model model = random_model(c);
  for (const int states : {1, 7, 8, 9, 65}) check_batches(model, states, c.seed + 20);
}

TEST_CASE("matrices at many states are those at one, for the robots of the data",
          "[dynamics][batch]") {
  for (const char* file : {"arm6.urdf", "arm7.urdf", "desk6.urdf", "gantry.urdf", "rail7.urdf",
                           "planar3.json", "planar4.json", "spatial3.json"}) {
    const Model model(
        description::read_robot(std::string(HAMELIN_SOURCE_DIR "/data/robots/") + file, {}));
    check_batches(model, 1000, 5);
  }
}

TEST_CASE("derivatives at many states agree with complex steps", "[dynamics][batch]") {
  const auto c = GENERATE(BatchChain{3, 7, 0, false, true}, BatchChain{4, 6, 2, false, false},
                          BatchChain{6, 4, 0, true, false}, BatchChain{7, 6, 3, true, true},
                          BatchChain{9, 20, 4, false, false});
  const Model model = random_model(c);
  const Index n = c.n;
  Rng rng(c.seed);
  BatchCalls calls(n, 9, 0, rng);
  DynamicsBatch batch(model);
  calls.run(batch);
  for (Index s = 0; s < 9; ++s) {
    CAPTURE(c.seed, s);
    const VectorXd q = calls.q.block().col(s), v = calls.v.block().col(s),
                   x = calls.x.block().col(s), a = calls.a.block().col(s);
    const MatrixXd of_inverse = test::complex_steps(model, q, v, x);
    const double size = 1e-2 * of_inverse.rightCols(n).norm();
    for (Index k = 0; k < 3; ++k) {
      const MatrixXd expected = of_inverse.middleCols(k * n, n);
      CHECK((matrix_of(calls.inverse[static_cast<std::size_t>(k)], n, s) - expected).norm() <=
            1e-12 * std::max(expected.norm(), size));
    }
    // at the accelerations of the torques x, of which forward dynamics has to be the inverse
    const MatrixXd of_forward = test::complex_steps(model, q, v, a);
    const MatrixXd M = of_forward.rightCols(n), inverse = matrix_of(calls.forward[2], n, s);
    const double condition = M.norm() * inverse.norm();
    CHECK((M * inverse - MatrixXd::Identity(n, n)).norm() <= 1e-14 * condition);
    for (Index k = 0; k < 2; ++k) {
      const MatrixXd expected = -M.ldlt().solve(of_forward.middleCols(k * n, n));
      CHECK((matrix_of(calls.forward[static_cast<std::size_t>(k)], n, s) - expected).norm() <=
            (1e-15 * condition + 1e-12) * expected.norm());
    }
  }
}

TEST_CASE("a state that is not finite, or huge, affects no other", "[dynamics][batch]") {
  const auto c = GENERATE(BatchChain{3, 7, 0, false, false}, BatchChain{4, 6, 2, false, true},
                          BatchChain{6, 4, 0, true, false});
  const Model model = random_model(c);
  const double infinity = std::numeric_limits<double>::infinity(),
               nan = std::numeric_limits<double>::quiet_NaN();
  for (const Isa isa : batch_sets()) {
    DynamicsBatch batch(model, {.isa = isa});
    FrameBatch frames(model, Model::tip_frame, {.isa = isa});
    Rng rng(1);
    BatchCalls clean(c.n, 16, 0, rng);
    clean.run(batch);
    StatesXd poses(12, 16), J(6 * c.n, 16), bad_poses(12, 16), bad_J(6 * c.n, 16);
    frames.evaluate(clean.q.block(), poses, J);
    for (const double bad : {nan, infinity, -infinity, 1e300, 3e7}) {
      for (Index s = 0; s < 16; s += 3) {
        CAPTURE(name_of(isa), bad, s);
        rng = Rng(1);
        BatchCalls calls(c.n, 16, 0, rng);
        calls.q.block()(1, s) = calls.v.block()(0, s) = calls.x.block()(2, s) = bad;
        calls.run(batch);
        CHECK(calls.equals(clean, 0, s));
        CHECK(calls.equals(clean, s + 1, 15 - s));
        if (!(bad > -infinity && bad < infinity)) {
          CHECK_FALSE(matrix_of(calls.M, c.n, s).allFinite());
          CHECK_FALSE(matrix_of(calls.forward[2], c.n, s).allFinite());
        }
        frames.evaluate(calls.q.block(), bad_poses, bad_J);
        CHECK(bad_poses.leftCols(s) == poses.leftCols(s));
        CHECK(bad_J.rightCols(15 - s) == J.rightCols(15 - s));
      }
    }
  }
}

TEST_CASE("results too large for the caches are those of small calls", "[dynamics][batch]") {
  const Model model = random_model({3, 7, 0, false, false});
  const Index states = 30000, piece = 100;
  const Index spare = GENERATE(0, 5, 8), offset = GENERATE(0, 1, 3);
  const int threads = GENERATE(1, 3);
  CAPTURE(spare, offset, threads);
  Rng rng(2);
  StatesXd q(7, offset + states + spare);
  for (double& x : q.reshaped()) x = rng.uniform(-3.0, 3.0);
  const auto at = [&](StatesXd& x) { return x.middleCols(offset, states); };
  StatesXd M = StatesXd::Constant(49, q.cols(), -7.0),
           poses = StatesXd::Constant(12, q.cols(), -7.0),
           J = StatesXd::Constant(42, q.cols(), -7.0);
  DynamicsBatch batch(model, {.threads = threads}), alone(model);
  FrameBatch frames(model, Model::tip_frame, {.threads = threads}),
      frames_alone(model, Model::tip_frame);
  batch.mass_matrix(at(q), at(M));
  frames.evaluate(at(q), at(poses), at(J));
  StatesXd some(7, piece), some_M(49, piece), some_poses(12, piece), some_J(42, piece);
  bool same = true;
  for (Index first = 0; first < states; first += piece) {
    some = at(q).middleCols(first, piece);
    alone.mass_matrix(some, some_M);
    frames_alone.evaluate(some, some_poses, some_J);
    same = same && some_M == at(M).middleCols(first, piece) &&
           some_poses == at(poses).middleCols(first, piece) &&
           some_J == at(J).middleCols(first, piece);
  }
  CHECK(same);
  for (const StatesXd* x : {&M, &poses, &J}) {
    CHECK((x->leftCols(offset).array() == -7.0).all());
    CHECK((x->rightCols(spare).array() == -7.0).all());
  }
}

TEST_CASE("arguments of DynamicsBatch that do not fit are refused, and nothing is allocated",
          "[dynamics][batch]") {
  const Model model = random_model({4, 6, 2, false, true});
  DynamicsBatch batch(model);
  Rng rng(1);
  BatchCalls calls(6, 40, 0, rng);
  StatesXd q = calls.q.block(), M(36, 40), fewer(36, 39), flat(6, 40);
  CHECK(test::error_of([&] { batch.mass_matrix(q, flat); }) ==
        "DynamicsBatch: M: 6 x 40 numbers with row stride 40 given, expected 36 x 40 with row "
        "stride 40, as q");
  CHECK_THROWS_AS(batch.mass_matrix(q, fewer), Error);
  CHECK_THROWS_AS(batch.mass_matrix(M, M), Error);
  StatesXd both(42, 40);
  both.topRows(6) = q;
  CHECK_THROWS_WITH(batch.mass_matrix(both.topRows(6), both.middleRows(5, 36)),
                    Catch::Contains("shares memory with q"));
  CHECK_NOTHROW(batch.mass_matrix(both.topRows(6), both.bottomRows(36)));
  StatesXd by_q(36, 40), by_v(36, 40);
  CHECK_THROWS_AS(batch.inverse_dynamics_derivatives(q, q.leftCols(39).eval(), q, by_q, by_v, M),
                  Error);
  CHECK_THROWS_WITH(
      batch.inverse_dynamics_derivatives(both.topRows(6), q, q, by_q, by_v, both.topRows(36)),
      Catch::Contains("dtau_da: shares memory with q"));
  CHECK_THROWS_AS(batch.forward_dynamics_derivatives(q, q, q, flat, by_q, by_v, flat), Error);
  CHECK_THROWS_WITH(batch.forward_dynamics_derivatives(q, flat, q, flat, by_q, by_v, M),
                    Catch::Contains("a: shares memory with v"));
  CHECK_THROWS_AS(DynamicsBatch(model, {.threads = 0}), Error);
  test::require_allocation_count();
  CHECK(test::allocations_in([&] {
          batch.mass_matrix(q, M);
          batch.inverse_dynamics_derivatives(q, q, q, by_q, by_v, M);
          batch.forward_dynamics_derivatives(q, q, q, flat, by_q, by_v, M);
        }) == 0);
}
