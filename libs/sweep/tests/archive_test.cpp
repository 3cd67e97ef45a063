#include "hamelin/sweep/archive.hpp"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "../src/tar.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/make_plan.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using namespace hamelin::sweep;

namespace {

namespace fs = std::filesystem;

const fs::path data_dir = fs::path(HAMELIN_SOURCE_DIR) / "data";

/// A folder with copies of a scene and its files, and a plan beside them.
class Study {
 public:
  Study() {
    for (const char* name :
         {"robots/arm7.urdf", "robots/arm7.spheres.json", "maps/shelf.bt", "scenes/shelf.json"}) {
      fs::create_directories((root() / "deep/in" / name).parent_path());
      fs::copy_file(data_dir / name, root() / "deep/in" / name);
    }
    options.files = {root() / "deep/in/scenes/shelf.json"};
    options.planners = {"hybrid"};
    options.seeds = {1, 2};
    options.plugin_directories = {HAMELIN_TEST_PLUGIN_DIR};
    plan = make_plan(directory(), options);
  }
  [[nodiscard]] const fs::path& root() const { return folder_.path(); }
  [[nodiscard]] fs::path directory() const { return root() / "deep/tries"; }
  [[nodiscard]] fs::path archive() const { return root() / "tries.tar.zst"; }
  [[nodiscard]] std::vector<const PlannedRun*> runs() const {
    return {&plan.runs.at(0), &plan.runs.at(1)};
  }

  PlanOptions options;
  Plan plan;

 private:
  test::TemporaryFolder folder_;
};

template <class F>
std::string message_of(F&& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// An archive with any description and any files.
void write_archive(const fs::path& file, const std::string& manifest,
                   const std::vector<std::pair<std::string, std::string>>& files) {
  TarWriter out(file);
  out.add(manifest_name, manifest);
  for (const auto& [name, bytes] : files) out.add(name, bytes);
  out.commit();
}

std::string manifest(const std::vector<std::pair<std::string, std::string>>& files) {
  Json list = Json::array();
  for (const auto& [name, bytes] : files)
    list.push_back({{"file", name}, {"sha256", sha256_hex(bytes)}, {"bytes", bytes.size()}});
  return Json{{"schema", "hamelin.archive/1"}, {"plan", "a/plan.json"}, {"files", list}}.dump();
}

}  // namespace

TEST_CASE("an unpacked sweep has the same plan, and its files are those that were planned",
          "[sweep][unit]") {
  const Study study;
  const Archived packed = pack(study.directory(), study.archive());
  CHECK(packed.directory == "tries");
  CHECK(packed.files == 5);
  const fs::path out = study.root() / "elsewhere/out";
  fs::create_directories(out.parent_path());
  const Archived unpacked = unpack(study.archive(), out);
  CHECK(unpacked.directory == "tries");
  CHECK(read_file(out / "tries/plan.json") == read_file(plan_file(study.directory())));
  CHECK_NOTHROW(check_files(read_plan(out / "tries"), out / "tries", study.runs()));
  CHECK(read_scene(study.plan.runs[0], out / "tries").map->file ==
        resolve_path(out, "in/maps/shelf.bt"));
  // again, and by several processes at once
  CHECK(unpack(study.archive(), out).files == 5);
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i)
    threads.emplace_back([&] { (void)unpack(study.archive(), study.root() / "together"); });
  for (auto& thread : threads) thread.join();
  CHECK(read_file(study.root() / "together/tries/plan.json") ==
        read_file(plan_file(study.directory())));
}

TEST_CASE("the same sweep gives the same archive to the byte", "[sweep][unit]") {
  const Study study;
  (void)pack(study.directory(), study.archive());
  const std::string bytes = read_file(study.archive());
  fs::last_write_time(study.root() / "deep/in/maps/shelf.bt", fs::file_time_type::clock::now());
  (void)pack(study.directory(), study.root() / "again");
  CHECK(read_file(study.root() / "again") == bytes);
}

TEST_CASE("what another machine could not have is not packed", "[sweep][unit]") {
  Study study;
  const auto message = [&] {
    return message_of([&] { (void)pack(study.directory(), study.archive()); });
  };
  const fs::path scene = study.root() / "deep/in/scenes/shelf.json";
  const std::string text = read_file(scene);
  std::ofstream(scene, std::ios::app) << " ";
  CHECK_THAT(message(), Catch::Contains("shelf.json: has changed since the sweep was planned"));
  Json document = parse_json(text, "");
  const std::string map = (study.root() / "deep/in/maps/shelf.bt").string();
  document["map"]["file"] = map;
  std::ofstream(scene) << document.dump();
  study.plan = make_plan(study.directory(), study.options);
  CHECK_THAT(message(), Catch::Contains("shelf.json: names the absolute path '" + map + "'"));
  std::ofstream(scene) << text;
  study.options.set = {"/map/file=" + map};
  study.plan = make_plan(study.directory(), study.options);
  CHECK_THAT(message(), Catch::Contains("run 'shelf/hybrid/s1': names the absolute path"));
  study.options.set = {};
  study.options.planners = {std::string(HAMELIN_TEST_PLUGIN_DIR) + "/hybrid.hamelin.so"};
  study.plan = make_plan(study.directory(), study.options);
  CHECK_THAT(message(), Catch::Contains("is named by its path, expected a name"));
  CHECK_FALSE(fs::exists(study.archive()));
  CHECK_FALSE(fs::exists(study.archive().string() + ".part"));
}

TEST_CASE("a folder with other content is not overwritten", "[sweep][unit]") {
  const Study study;
  (void)pack(study.directory(), study.archive());
  const fs::path out = study.root() / "out";
  const auto message = [&] { return message_of([&] { (void)unpack(study.archive(), out); }); };
  fs::create_directories(out);
  std::ofstream(out / "mine") << "mine";
  CHECK_THAT(
      message(),
      Catch::EndsWith("out: exists already, expected a new folder, or one with this archive"));
  CHECK(read_file(out / "mine") == "mine");
  fs::remove_all(out);
  (void)unpack(study.archive(), out);
  std::ofstream(out / "in/maps/shelf.bt", std::ios::app) << " ";
  CHECK_THAT(message(), Catch::Contains("'in/maps/shelf.bt' has the SHA-256"));
}

TEST_CASE("an archive that is cut or damaged anywhere leaves nothing behind", "[sweep][unit]") {
  const Study study;
  (void)pack(study.directory(), study.archive());
  const std::string bytes = read_file(study.archive());
  const fs::path broken = study.root() / "broken", out = study.root() / "out";
  std::size_t refused = 0;
  const auto try_bytes = [&](const std::string& content) {
    std::ofstream(broken, std::ios::binary) << content;
    const std::string message = message_of([&] { (void)unpack(broken, out); });
    if (!message.empty()) {
      ++refused;
      CHECK(message.find("broken") != std::string::npos);
      CHECK_FALSE(fs::exists(out));
    } else {  // the damage is in bytes without a meaning
      CHECK(read_file(out / "tries/plan.json") == read_file(plan_file(study.directory())));
      fs::remove_all(out);
    }
  };
  for (std::size_t i = 0; i < 40; ++i) try_bytes(bytes.substr(0, i * bytes.size() / 40));
  CHECK(refused == 40);
  for (std::size_t i = 0; i < 60; ++i) {
    std::string content = bytes;
    content[i * bytes.size() / 60] = static_cast<char>(content[i * bytes.size() / 60] ^ 0x55);
    try_bytes(content);
  }
  CHECK(refused > 90);
  for (const auto& entry : fs::directory_iterator(study.root()))
    CHECK_FALSE(entry.path().filename().string().starts_with("out"));
}

TEST_CASE("an archive made by an adversary does not write outside of its folder", "[sweep][unit]") {
  const test::TemporaryFolder folder;
  const fs::path file = folder.path() / "bad", out = folder.path() / "out";
  using Files = std::vector<std::pair<std::string, std::string>>;
  const auto message = [&](const std::string& description, const Files& files) {
    write_archive(file, description, files);
    const std::string text = message_of([&] { (void)unpack(file, out); });
    CHECK_FALSE(fs::exists(out));
    CHECK_FALSE(fs::exists(folder.path() / "evil"));
    return text;
  };
  const Files good{{"a/plan.json", "{}"}, {"b", "x"}};
  for (const char* name : {"../evil", "/tmp/evil", "a/../../evil", "a/./b", "a//b", "a/", ".", "..",
                           "hamelin-archive.json"}) {
    Files files = good;
    files.emplace_back(name, "x");
    CHECK_THAT(message(manifest(files), good),
               Catch::Contains(fmt::format("'{}' is not a plain relative path", name)));
  }
  CHECK_THAT(message(manifest(good), {good[0], good[1], {"../evil", "x"}}),
             Catch::Contains("'../evil' is not listed"));
  CHECK_THAT(message(manifest(good), {good[0], good[1], good[1]}),
             Catch::Contains("'b' is there twice"));
  CHECK_THAT(message(manifest(good), {good[0]}), Catch::Contains("'b' is missing"));
  CHECK_THAT(message(manifest(good), {good[0], {"b", "y"}}),
             Catch::Contains("'b' has the SHA-256"));
  CHECK_THAT(message(manifest({good[0], good[1], good[1]}), good),
             Catch::Contains("'b' is listed twice"));
  CHECK_THAT(message(manifest({good[1]}), {good[1]}),
             Catch::Contains("'a/plan.json' is not among the files"));
  CHECK_THAT(message(manifest({good[0], {"a", "x"}}), {{"a", "x"}, good[0]}),
             Catch::Contains("cannot be written"));
  CHECK_THAT(message("{\"schema\": 1}", good), Catch::Contains("hamelin-archive.json"));
  std::ofstream(file, std::ios::binary) << "no archive";
  CHECK_THAT(message_of([&] { (void)unpack(file, out); }), Catch::Contains("is not an archive"));
  CHECK_THAT(message_of([&] { (void)unpack(folder.path(), out); }),
             Catch::Contains("is not a file"));
  CHECK_THAT(message_of([&] { (void)unpack(folder.path() / "none", out); }),
             Catch::Contains("none: is not a file"));
}
