#include "hamelin/planning/plugin.hpp"

#include <Eigen/Geometry>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/description/robot_io.hpp"

namespace hamelin::planning {

model::Model Setup::model() const {
  const std::string where = "nominal robot";
  const auto& w = raw_->base_quaternion_wxyz;
  const geometry::SE3 base(
      Eigen::Quaterniond(w[0], w[1], w[2], w[3]).normalized().toRotationMatrix(),
      vec3(raw_->base_position_world_m));
  return model::Model(description::robot_from_json(parse_json(robot_json(), where), where), base,
                      vec3(raw_->gravity_world_m_s2));
}

void check_fixed_params(const Json& params, const Json& initial,
                        std::span<const char* const> keys) {
  for (const char* key : keys)
    if (params.at(key) != initial.at(key))
      throw Error(ErrorCode::invalid, std::string("/") + key +
                                          ": cannot be changed while it runs, expected " +
                                          initial.at(key).dump());
}

namespace detail {
namespace {

void write_line(std::string_view text, char* error, std::size_t error_size) noexcept {
  if (error_size == 0) return;
  const std::size_t size = std::min(text.size(), error_size - 1);
  std::replace_copy(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(size), error, '\n',
                    ' ');
  error[size] = '\0';
}

}  // namespace

void take_instruction_set(const hamelin_setup& setup) noexcept {
  if (setup.instruction_set == nullptr) return;
  try {
    set_default_isa(isa_from_name(setup.instruction_set, "instruction_set"));
  } catch (const Error&) {
    // The name comes from a later host: the plugin keeps its own default.
  }
}

void write_current_exception(char* error, std::size_t error_size) noexcept {
  try {
    throw;
  } catch (const std::exception& e) {
    write_line(e.what(), error, error_size);
  } catch (...) {
    write_line("an exception that is not a std::exception", error, error_size);
  }
}

}  // namespace detail
}  // namespace hamelin::planning
