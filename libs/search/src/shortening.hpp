#pragma once
#include <Eigen/Core>

#include "hamelin/core/rng.hpp"

namespace hamelin::search {

/// Shortens a path by straight lines that are proved: from each way-point to the farthest that it
/// can see, then between random places, then the first again. From then on it is improved by random
/// vias beside it. Lengths are Euclidean. Lines are proposed, and proved by others.
/// No allocation with paths of up to 256 points.
class Shortening {
 public:
  explicit Shortening(Eigen::Index dof);

  /// @param points dof × way-points
  void begin(const Eigen::Ref<const Eigen::MatrixXd>& points);
  /// Whether all that shortens was tried.
  [[nodiscard]] bool shortened() const noexcept { return phase_ == Phase::improve || count_ <= 2; }
  /// Chooses the next line. @return whether there is one to be proved, from() to()
  [[nodiscard]] bool propose(Rng& rng);
  [[nodiscard]] const Eigen::VectorXd& from() const noexcept { return p_; }
  [[nodiscard]] const Eigen::VectorXd& to() const noexcept { return r_; }
  /// Takes the answer for this line. @return whether there is another one that belongs to it
  [[nodiscard]] bool answer(bool clear);
  /// dof × way-points.
  [[nodiscard]] auto points() const { return path_.leftCols(count_); }

 private:
  enum class Phase { skip, cut, skip_again, improve };
  /// The line that was proposed to improve the path.
  enum class Line { direct, to_via, from_via };
  /// A place on the path: the way-point before it, and where it is.
  struct Place {
    Eigen::Index after = 0;
    Eigen::VectorXd q;
  };
  void begin_skip();
  [[nodiscard]] bool propose_skip();
  void keep_skip();
  [[nodiscard]] bool propose_cut(Rng& rng);
  void end_cut();
  [[nodiscard]] bool propose_improvement(Rng& rng);
  [[nodiscard]] bool propose_via();
  [[nodiscard]] bool answer_improvement(bool clear);
  /// Whether lines of this length in place of the stretch between the two places are worth while.
  [[nodiscard]] bool gains(double length) const;
  void draw_places(Rng& rng);
  void place_at(double s, Place& out) const;
  /// Replaces the stretch between the two places by a line, or by lines to a via and on.
  void replace(const Eigen::VectorXd* via);
  void keep(const Eigen::VectorXd& q);
  void take_kept();

  Eigen::MatrixXd path_, kept_;  ///< of which the first columns count
  Eigen::Index count_ = 0, kept_count_ = 0;
  double length_ = 0.0;
  Phase phase_ = Phase::improve;
  Line line_ = Line::direct;
  Eigen::Index from_ = 0, to_ = 0;  ///< of the line to be tried next, while points are left out
  int cuts_ = 0;
  Place a_, b_;         ///< that were drawn
  double along_ = 0.0;  ///< the path between them
  Eigen::VectorXd via_, p_, r_;
};

}  // namespace hamelin::search
