#pragma once
#include <mujoco/mujoco.h>

#include <cstddef>
#include <memory>
#include <string>

#include "hamelin/core/shared_library.hpp"

namespace hamelin::mujoco {

/// The functions of MuJoCo that are used; it is loaded for the first plant.
struct Api {
  SharedLibrary library{HAMELIN_MUJOCO_FILE, "the plant mujoco"};
  HAMELIN_LOADED(library, mj_applyFT);
  HAMELIN_LOADED(library, mj_defaultVFS);
  HAMELIN_LOADED(library, mj_deleteData);
  HAMELIN_LOADED(library, mj_deleteModel);
  HAMELIN_LOADED(library, mj_deleteVFS);
  HAMELIN_LOADED(library, mj_freeLastXML);
  HAMELIN_LOADED(library, mj_id2name);
  HAMELIN_LOADED(library, mj_loadXML);
  HAMELIN_LOADED(library, mj_makeData);
  HAMELIN_LOADED(library, mj_makeEmptyFileVFS);
  HAMELIN_LOADED(library, mj_name2id);
  HAMELIN_LOADED(library, mj_resetData);
  HAMELIN_LOADED(library, mj_setConst);
  HAMELIN_LOADED(library, mj_step1);
  HAMELIN_LOADED(library, mj_step2);
  HAMELIN_LOADED(library, mj_versionString);
  HAMELIN_LOADED(library, mju_user_error);    // a pointer to the variable
  HAMELIN_LOADED(library, mju_user_warning);  // a pointer to the variable
};

/// @throws Error io if MuJoCo is not installed
[[nodiscard]] const Api& api();

struct ModelDeleter {
  void operator()(mjModel* model) const noexcept { api().mj_deleteModel(model); }
};
struct DataDeleter {
  void operator()(mjData* data) const noexcept { api().mj_deleteData(data); }
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
