#pragma once
#include "../src/transcription.hpp"
#include "nonlinear_program.hpp"

namespace hamelin::optimal {

/// A Transcription as a general solver sees it.
class TranscriptionProgram final : public NonlinearProgram {
 public:
  explicit TranscriptionProgram(Transcription& of)
      : of_(of), matrix_(of.hessian_matrix()), no_weights_(VectorXd::Zero(of.rows())) {}

  [[nodiscard]] Index variables() const override { return of_.variables(); }
  [[nodiscard]] const VectorXd& lower() const override { return of_.lower(); }
  [[nodiscard]] const VectorXd& upper() const override { return of_.upper(); }
  [[nodiscard]] bool evaluate(const VectorXd& x) override { return of_.evaluate(x); }
  [[nodiscard]] double cost() const override { return of_.cost(); }
  void gradient(VectorXd& out) const override { of_.gradient(out); }
  [[nodiscard]] const VectorXd& values() const override { return of_.values(); }
  [[nodiscard]] std::vector<Entry> jacobian_entries() const override {
    std::vector<Entry> out;
    of_.for_each_entry<true>([&](Index r, Index v, double) { out.push_back({r, v}); });
    return out;
  }
  void jacobian(double* values) const override {
    of_.for_each_entry<true>([&](Index, Index, double d) { *values++ = d; });
  }
  [[nodiscard]] std::vector<Entry> hessian_entries() const override {
    std::vector<Entry> out;
    for_each_in_triangle([&](Index r, Index c, double) { out.push_back({r, c}); });
    return out;
  }
  void hessian(double factor, const VectorXd& y, double* values) override {
    of_.hessian(factor, y, no_weights_, true, matrix_);
    for_each_in_triangle([&](Index, Index, double x) { *values++ = x; });
  }

 private:
  /// Calls f(row, column, value) for the lower triangle of matrix_.
  template <class F>
  void for_each_in_triangle(F&& f) const {
    const Index n = of_.layout().joints(), blocks = matrix_.blocks();
    for (Index c = 0; c < blocks; ++c)
      for (Index r = c; r < std::min(blocks, c + matrix_.reach() + 1); ++r) {
        const auto block = matrix_.block(r, c);
        for (Index j = 0; j < n; ++j)
          for (Index i = r == c ? j : 0; i < n; ++i) f(r * n + i, c * n + j, block(i, j));
      }
    if (!matrix_.bordered()) return;
    for (Index i = 0; i < blocks * n; ++i) f(blocks * n, i, matrix_.border()[i]);
    f(blocks * n, blocks * n, matrix_.corner());
  }

  Transcription& of_;
  BandedMatrix matrix_;
  VectorXd no_weights_;
};

}  // namespace hamelin::optimal
