#pragma once
#include <mujoco/mujoco.h>

#include <cstddef>
#include <memory>
#include <string>

namespace hamelin::mujoco {

struct ModelDeleter {
  void operator()(mjModel* model) const noexcept { mj_deleteModel(model); }
};
struct DataDeleter {
  void operator()(mjData* data) const noexcept { mj_deleteData(data); }
};
using ModelPointer = std::unique_ptr<mjModel, ModelDeleter>;
using DataPointer = std::unique_ptr<mjData, DataDeleter>;

/// The three numbers of item i in one of MuJoCo's arrays of vectors.
[[nodiscard]] inline mjtNum* vector_of(mjtNum* array, int i) noexcept {
  return array + 3 * static_cast<std::ptrdiff_t>(i);
}
[[nodiscard]] inline const mjtNum* vector_of(const mjtNum* array, int i) noexcept {
  return array + 3 * static_cast<std::ptrdiff_t>(i);
}

/// Compiles a model from text, without files. From the first call on, errors of MuJoCo are
/// exceptions and its warnings are silent, in the whole process.
/// @param where prefix of messages
/// @throws Error invalid
[[nodiscard]] ModelPointer load_model(const std::string& mjcf, const std::string& where);

}  // namespace hamelin::mujoco
