#pragma once
#include <string>
#include <vector>

#include "hamelin/dynamics/wrenches.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::simulation {

/// The wrenches of a scene that act, as time goes on.
class WrenchFeed {
 public:
  /// @param place of the list, for messages: "scene.json: /wrenches"
  /// @throws Error invalid for a frame that the robot does not have
  WrenchFeed(const std::vector<scene::WrenchSpec>& given, const model::Model& model,
             const std::string& place);
  /// Those that act on the step from a node. @return whether they are others than before
  [[nodiscard]] bool advance(double time_s);
  [[nodiscard]] const std::vector<dynamics::ExternalWrench>& active() const noexcept {
    return active_;
  }
  /// What acts, in a line for a log.
  [[nodiscard]] std::string describe() const;

 private:
  struct Timed {
    std::string name;  ///< of its frame
    dynamics::ExternalWrench wrench;
    double from_s, to_s;
    bool acts = false;
  };
  std::vector<Timed> all_;
  std::vector<dynamics::ExternalWrench> active_;
};

}  // namespace hamelin::simulation
