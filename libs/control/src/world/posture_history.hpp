#pragma once
#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <optional>
#include <vector>

namespace hamelin::control {

/// Where the joints of an arm were a short time ago. One thread records without waiting and without
/// allocating; any other may ask meanwhile.
class PostureHistory {
 public:
  struct Posture {
    double time_s = 0.0;
    std::uint64_t load = 0;  ///< number of what the arm carries
    Eigen::VectorXd q;
  };

  PostureHistory(Eigen::Index dof, std::size_t capacity);

  /// Times that fall begin a new history.
  void record(double time_s, const Eigen::VectorXd& q, std::uint64_t load) noexcept;

  /// The last one; none if there is none.
  [[nodiscard]] std::optional<Posture> newest() const;
  /// The posture at a time, linear between the two around it, with the load of the earlier one;
  /// the newest for later times. None if no posture is so old.
  [[nodiscard]] std::optional<Posture> at(double time_s) const;

 private:
  [[nodiscard]] std::optional<Posture> read(std::uint64_t index) const;
  [[nodiscard]] std::atomic<double>* entry(std::uint64_t index) noexcept {
    return &values_[static_cast<std::size_t>(index % capacity_) * stride_];
  }
  [[nodiscard]] const std::atomic<double>* entry(std::uint64_t index) const noexcept {
    return &values_[static_cast<std::size_t>(index % capacity_) * stride_];
  }

  std::size_t dof_, stride_;
  std::uint64_t capacity_;
  std::vector<std::atomic<double>> values_;  ///< per posture: time, load, q
  /// Postures recorded so far; the first of them that belongs to this history.
  std::atomic<std::uint64_t> count_{0}, first_{0};
  double last_s_ = 0.0;
};

}  // namespace hamelin::control
