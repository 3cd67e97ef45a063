#include "hamelin/identification/record.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/core/error.hpp"

namespace hamelin::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

void check_matrix(const Record& record, const MatrixXd& matrix, const char* name, Index dof,
                  bool may_be_empty) {
  const auto ticks = static_cast<Index>(record.ticks());
  if (may_be_empty && matrix.size() == 0) return;
  if (matrix.rows() != dof || matrix.cols() != ticks)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: {}: has {} × {} numbers, expected {} × {} (joints, ticks)",
                            record.where, name, matrix.rows(), matrix.cols(), dof, ticks));
  for (Index k = 0; k < ticks; ++k)
    if (record.usable[static_cast<std::size_t>(k)] != 0 && !matrix.col(k).allFinite())
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: {} at {} s: is not finite, expected finite numbers",
                              record.where, name, record.time_s[static_cast<std::size_t>(k)]));
}

}  // namespace

void check(const Record& record, const model::Robot& robot) {
  if (record.usable.size() != record.ticks())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: usable: has {} flags, expected {}", record.where,
                            record.usable.size(), record.ticks()));
  for (std::size_t k = 0; k < record.ticks(); ++k)
    if (!std::isfinite(record.time_s[k]) || (k > 0 && record.time_s[k] <= record.time_s[k - 1]))
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: tick {}: time {} s, expected increasing times", record.where,
                              k + 1, record.time_s[k]));
  const Index dof = robot.dof();
  check_matrix(record, record.q, "q", dof, false);
  check_matrix(record, record.held, "held torques", dof, true);
  check_matrix(record, record.sampled, "sampled torques", dof, true);
  check_matrix(record, record.impulses, "impulses", dof, true);
  if (record.ticks() > 0 && record.held.size() == 0 && record.sampled.size() == 0)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no torques, expected those of the motors", record.where));
}

Record thinned(const Record& record, long every) {
  if (every < 1)
    throw Error(ErrorCode::usage, fmt::format("every {}: expected at least 1 tick", every));
  if (every == 1) return record;
  Record out = record;
  const auto step = static_cast<std::size_t>(every);
  const std::size_t ticks = record.ticks(), kept = (ticks + step - 1) / step;
  const auto resize = [&](MatrixXd& matrix) {
    if (matrix.size() > 0) matrix.setZero(matrix.rows(), static_cast<Index>(kept));
  };
  for (MatrixXd* matrix : {&out.q, &out.held, &out.sampled, &out.impulses}) resize(*matrix);
  out.time_s.resize(kept);
  out.usable.assign(kept, 1);
  for (std::size_t k = 0; k < kept; ++k) {
    const std::size_t from = k * step, to = std::min(ticks, from + step);
    const auto at = static_cast<Index>(k);
    out.time_s[k] = record.time_s[from];
    out.q.col(at) = record.q.col(static_cast<Index>(from));
    if (out.sampled.size() > 0) out.sampled.col(at) = record.sampled.col(static_cast<Index>(from));
    double sum = 0.0;
    for (std::size_t i = from; i < to; ++i) {
      const auto tick = static_cast<Index>(i);
      if (record.usable[i] == 0) out.usable[k] = 0;
      if (out.impulses.size() > 0) out.impulses.col(at) += record.impulses.col(tick);
      // the last tick's torque acts for an unknown time, and is not used
      const double length = i + 1 < ticks ? record.time_s[i + 1] - record.time_s[i] : 0.0;
      if (out.held.size() > 0) out.held.col(at) += length * record.held.col(tick);
      sum += length;
    }
    if (out.held.size() > 0 && sum > 0.0) out.held.col(at) /= sum;
  }
  return out;
}

}  // namespace hamelin::identification
