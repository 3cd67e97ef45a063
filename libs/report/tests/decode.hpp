#pragma once
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "hamelin/control/preparation.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/report/report.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/temporary.hpp"

/// Reads the bytes of make_data, following the layout in the library's README, and makes logs for
/// it.
namespace hamelin::test {

struct Decoded {
  Json head;
  std::string blob;

  explicit Decoded(const std::string& bytes) {
    std::uint32_t size = 0;
    REQUIRE(bytes.size() >= 4);
    std::memcpy(&size, bytes.data(), 4);
    head = Json::parse(bytes.substr(4, size));
    blob = bytes.substr((4 + size + 7) / 8 * 8);
  }

  [[nodiscard]] std::vector<double> operator()(const Json& array) const {
    const std::string type = array["type"];
    if (type == "f64") return values<double>(array);
    if (type == "f32") return values<float>(array);
    if (type == "i32") return values<std::int32_t>(array);
    if (type == "i16") return values<std::int16_t>(array);
    if (type == "u16") return values<std::uint16_t>(array);
    REQUIRE(type == "u8");
    return values<std::uint8_t>(array);
  }

  /// The plot of a run with this id.
  [[nodiscard]] const Json& plot(std::size_t run, const std::string& id) const {
    for (const auto& plot : head["runs"][run]["plots"])
      if (plot["id"] == id) return plot;
    FAIL("no plot " << id);
    return head;
  }

 private:
  template <class T>
  std::vector<double> values(const Json& array) const {
    const std::size_t at = array["at"], n = array["n"];
    REQUIRE(at % 8 == 0);
    REQUIRE(at + n * sizeof(T) <= blob.size());
    std::vector<T> raw(n);
    if (n > 0) std::memcpy(raw.data(), blob.data() + at, n * sizeof(T));
    std::vector<double> out;
    for (const T value : raw) {
      const auto number = static_cast<double>(value);
      const bool none = array.contains("none") && number == array["none"].get<double>();
      out.push_back(none ? std::numeric_limits<double>::quiet_NaN()
                         : array.value("offset", 0.0) + array.value("scale", 1.0) * number);
    }
    return out;
  }
};

/// An empty folder for one test.
inline std::filesystem::path scratch(const std::string& name) {
  const auto folder = temporary("report_" + name);
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

inline std::filesystem::path checkout(const std::string& file) {
  return std::filesystem::path(HAMELIN_SOURCE_DIR) / file;
}

/// Runs a scene and logs it, in free motion if it has no planner.
inline log::Result log_run(const scene::Scene& scene, const std::filesystem::path& file,
                           long every = 1) {
  log::RunLog log(file);
  simulation::Watch watch;
  watch.log = &log;
  watch.every = every;
  if (scene.planner) return simulation::run(scene, {HAMELIN_TEST_PLUGIN_DIR}, watch);
  const model::Model model = control::load_model(scene);
  return simulation::integrate(model, simulation::free_motion(scene, model), watch);
}

inline std::vector<Json> ticks_of(const std::filesystem::path& file) {
  std::vector<Json> ticks;
  for (auto& line : log::read_log(file).lines)
    if (line["type"] == "tick") ticks.push_back(std::move(line));
  return ticks;
}

inline scene::Scene shelf(double duration_s) {
  scene::Scene scene = scene::read_scene(checkout("data/scenes/shelf.json"));
  scene.duration_s = duration_s;
  return scene;
}

inline Eigen::VectorXd vector_of(const Json& numbers) {
  Eigen::VectorXd x(static_cast<Eigen::Index>(numbers.size()));
  for (std::size_t i = 0; i < numbers.size(); ++i)
    x[static_cast<Eigen::Index>(i)] = numbers[i].get<double>();
  return x;
}

/// Triple i of a list of triples.
inline Eigen::Vector3d triple(const std::vector<double>& numbers, std::size_t i) {
  return {numbers.at(3 * i), numbers.at(3 * i + 1), numbers.at(3 * i + 2)};
}

}  // namespace hamelin::test
