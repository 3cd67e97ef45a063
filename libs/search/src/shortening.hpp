#pragma once
#include <Eigen/Core>

#include "hamelin/core/rng.hpp"
#include "hamelin/search/query.hpp"

namespace hamelin::search {

/// Shortens a path by straight lines that are proved, one motion at a time: from each way-point to
/// the farthest that it can see, then between random places, then the first again; and improves it
/// for as long as asked, by random vias beside it. Lengths are Euclidean.
/// No allocation with paths of up to 256 points.
class Shortening {
 public:
  explicit Shortening(Eigen::Index dof);

  /// @param points dof × way-points
  void begin(const Eigen::Ref<const Eigen::MatrixXd>& points);
  /// Tries one line. @return whether shortening has ended
  [[nodiscard]] bool step(Query& query, Rng& rng);
  /// Tries one cut or one via between two places of the path.
  void improve(Query& query, Rng& rng);
  /// dof × way-points.
  [[nodiscard]] auto points() const { return path_.leftCols(count_); }

 private:
  enum class Phase { skip, cut, skip_again, ended };
  /// A place on the path: the way-point before it, and where it is.
  struct Place {
    Eigen::Index after = 0;
    Eigen::VectorXd q;
  };
  void begin_skip();
  void skip(Query& query);
  void cut(Query& query, Rng& rng);
  /// Draws two places. @return their distance along the path
  double draw_places(Rng& rng);
  void place_at(double s, Place& out) const;
  /// Replaces the stretch between the two places by a line, or by lines to a via and on.
  void replace(const Eigen::VectorXd* via);
  void keep(const Eigen::VectorXd& q);
  void take_kept();

  Eigen::MatrixXd path_, kept_;  ///< of which the first columns count
  Eigen::Index count_ = 0, kept_count_ = 0;
  double length_ = 0.0;
  Phase phase_ = Phase::ended;
  Eigen::Index from_ = 0, to_ = 0;  ///< of the line to be tried next, while points are left out
  int cuts_ = 0;
  Place a_, b_;
  Eigen::VectorXd via_, p_, r_;
};

}  // namespace hamelin::search
