#pragma once
#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "guide/guide_query.hpp"
#include "guide/motion_search.hpp"
#include "loop/newest.hpp"

namespace hamelin::control {

/// What a tick asks of a guide.
struct GuideRequest {
  /// @param points_max the largest number of way-points of `kept`
  GuideRequest(Eigen::Index dof, Eigen::Index points_max);

  std::uint64_t number = 0;     ///< of the request; 0: none
  double time_s = 0.0;          ///< of the tick
  std::uint64_t allowance = 0;  ///< number of what may be touched, see World::allow()
  Eigen::VectorXd q;            ///< where the search begins
  Eigen::VectorXd way_start;    ///< where the way of a goal begins that has one
  std::shared_ptr<const std::vector<scene::Goal>> goals;  ///< with the goal; null in between
  std::size_t goal = 0;                                   ///< its index
  std::optional<Lead> lead;                               ///< on which the motion begins, at speed
  bool passes = false;  ///< and goes past the goal before; its time is when it may begin
  std::optional<geometry::SE3> target;  ///< where what a follow goal follows is
  std::uint64_t search = 0;             ///< number of the search, see search::Problem
  /// A path that is kept if it is still clear: its first kept_count columns; 0: none.
  Eigen::MatrixXd kept;
  Eigen::Index kept_count = 0;
};

struct GuideAnswer {
  std::uint64_t number = 0;    ///< of the request; 0: none yet
  std::uint64_t snapshot = 0;  ///< of the world that it is for
  bool kept = false;           ///< whether the path of the request is still clear
  long checks = 0;
  search::Path path;
  /// The motion along the path; null if there is none, or none is asked for.
  std::unique_ptr<CertifiedPath> motion;
  std::string motion_cause;  ///< one line: why the path has no motion
  std::optional<Lead> lead;  ///< on which it begins
  /// On its clock, until when it is within the tolerances of a goal that it passes.
  double passed_by_s = 0.0;
};

/// Answers the requests of a control loop, one at a time: on a thread of its own, or where its
/// owner says so. The tick hands requests over and takes answers without locks or allocation.
class GuideSearch {
 public:
  /// @param points_max as for GuideRequest
  /// @param threaded whether it has a thread of its own; else run() does the work
  /// model, world and view must outlive this
  GuideSearch(const model::Model& model, const World& world, const WorldView& view,
              std::unique_ptr<MotionSearch> search, Eigen::Index points_max, bool threaded);
  GuideSearch(const GuideSearch&) = delete;
  GuideSearch& operator=(const GuideSearch&) = delete;
  ~GuideSearch();

  /// Whether a request is waiting or at work. For the thread of the tick, as the next three.
  [[nodiscard]] bool busy() const noexcept { return state_.load() != State::idle; }
  /// The request to be filled in; only while it is not busy.
  [[nodiscard]] GuideRequest& request() noexcept { return request_; }
  /// Starts the work on request().
  void ask() noexcept;
  /// The newest answer, valid until the next call.
  [[nodiscard]] GuideAnswer& take() noexcept { return answers_.take(); }
  /// Does the work that is waiting, if there is any, without a thread of its own.
  void run();

 private:
  enum class State : std::int32_t { idle, asked, ended };
  void work();
  void answer();
  [[nodiscard]] bool still_clear();
  void find(GuideAnswer& out);
  [[nodiscard]] search::Problem problem() const;

  std::unique_ptr<MotionSearch> search_;
  GuideQuery query_;
  GuideRequest request_;
  Newest<GuideAnswer> answers_;
  std::atomic<State> state_{State::idle};
  std::thread thread_;
};

}  // namespace hamelin::control
