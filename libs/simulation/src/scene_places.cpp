#include "scene_places.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"

namespace hamelin::simulation {

int named_frame(const model::Model& model, const std::string& name, const std::string& place) {
  try {
    return model.frame(name);
  } catch (const Error& e) {
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", place, e.what()));
  }
}

}  // namespace hamelin::simulation
