#pragma once
#include <Eigen/Core>

#include "hamelin/model/model.hpp"
#include "hamelin/scene/self_collision.hpp"

namespace hamelin::scene {

/// Upper bounds of how far a joint moves a shape of the arm, whatever the configuration:
/// docs/theory.md (12.3), and (12.11) for pairs of parts, in the frame of the part nearer to the
/// base. With them, changes of joint positions bound changes of distances. No allocation after
/// construction.
class Levers {
 public:
  /// @param self null if self-collision is not modelled
  Levers(const model::Model& model, const SelfField* self);

  /// shapes × dof [m/rad, or 1 for prismatic joints].
  [[nodiscard]] const Eigen::MatrixXd& shapes() const noexcept { return shapes_; }
  /// Of the tip; zero for joints behind it.
  [[nodiscard]] const Eigen::VectorXd& tip() const noexcept { return tip_; }
  /// SelfField::pairs() × dof.
  [[nodiscard]] const Eigen::MatrixXd& pairs() const noexcept { return pairs_; }

  /// How far a deviation of the joints moves any shape, or two parts to each other, at most [m].
  [[nodiscard]] double reach(const Eigen::VectorXd& deviation) const;

  /// Extends the travel of prismatic joints, on which the levers of the joints before them depend,
  /// if one of them may reach beyond it. @param stray how far each joint may be from q
  void extend_travel(const Eigen::VectorXd& q, const Eigen::VectorXd& stray);

  /// The vector c whose product with the levers of a shape bounds the second derivative κ of its
  /// points along the line q + s dq, docs/theory.md (12.5).
  void curvature(const Eigen::VectorXd& dq, Eigen::VectorXd& c) const;

  /// Whether a joint is prismatic.
  [[nodiscard]] bool slides(Eigen::Index joint) const {
    return model_.robot().links[static_cast<std::size_t>(joint)].joint.type ==
           model::JointType::prismatic;
  }

 private:
  void set();
  /// The levers of what is so far from the origin of a link's frame.
  void fill(int link, double length,
            Eigen::Ref<Eigen::RowVectorXd, 0, Eigen::InnerStride<>> levers) const;

  const model::Model& model_;
  const SelfField* self_;
  Eigen::VectorXd frame_distance_;  ///< of successive joint frames at q = 0 [m]
  Eigen::VectorXd travel_;          ///< largest |q| of prismatic joints [m]
  Eigen::MatrixXd shapes_, pairs_;
  Eigen::VectorXd tip_;
};

}  // namespace hamelin::scene
