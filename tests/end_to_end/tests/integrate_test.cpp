#include <fmt/format.h>

#include <array>
#include <cmath>

#include "../program.hpp"

using namespace hamelin;
using test::Sandbox;

namespace {

/// One sample of example 5.1 of Shen, Wang, Shi (2021), step h = 0.01 s, computed by an independent
/// program.
struct Sample {
  const char *integrator, *alpha, *solver, *duration;
  std::array<double, 3> q;
};

const std::vector<Sample> samples = {
    {"hamel",
     "0",
     "feedback",
     "0.1",
     {-0.0130649726632975, 0.00527798406337573, 0.00519996513620724}},
    {"hamel", "0", "feedback", "1", {-1.14512961686682, 0.440283438449196, 0.466368395013248}},
    {"hamel", "0", "feedback", "10", {-0.373736823060162, -2.54294551587614, 2.83414494847184}},
    {"hamel",
     "0.5",
     "feedback",
     "0.1",
     {-0.0130649725776983, 0.00527798416179955, 0.00519996502756071}},
    {"hamel", "0.5", "feedback", "1", {-1.14512117868807, 0.440289746588229, 0.466359551528809}},
    {"hamel", "0.5", "feedback", "10", {-0.373087967210292, -2.54358927688306, 2.83409891864577}},
    {"hamel",
     "1",
     "feedback",
     "0.1",
     {-0.0130649724920991, 0.00527798426022335, 0.00519996491891417}},
    {"hamel", "1", "feedback", "1", {-1.14511274037385, 0.4402960534363, 0.466350708521288}},
    {"hamel", "1", "feedback", "10", {-0.372438575544831, -2.54423379873996, 2.83405309283892}},
    {"hamel-variational",
     "",
     "feedback",
     "0.1",
     {-0.0118772595693823, 0.00479817668911103, 0.00472724337332312}},
    {"hamel-variational",
     "",
     "feedback",
     "1",
     {-1.1348081655737, 0.436717727586177, 0.461972936309557}},
    {"hamel-variational",
     "",
     "feedback",
     "10",
     {-0.362112983711314, -2.56064550521602, 2.83846385177002}},
    {"hamel-variational",
     "",
     "newton",
     "0.1",
     {-0.0118772595693823, 0.00479817668911103, 0.00472724337332312}},
    {"hamel-variational",
     "",
     "newton",
     "1",
     {-1.1348081655737, 0.436717727586177, 0.461972936309557}},
    {"hamel-variational",
     "",
     "newton",
     "10",
     {-0.362112983711314, -2.56064550521602, 2.83846385177002}},
};

std::vector<std::string> command_of(const Sample& sample) {
  std::vector<std::string> command = {"integrate",    "data/robots/planar3.json",
                                      "--integrator", sample.integrator,
                                      "--solver",     sample.solver,
                                      "--step",       "0.01",
                                      "--duration",   sample.duration};
  if (*sample.alpha != '\0')
    for (const char* argument : {"--alpha", sample.alpha, "--start", "published"})
      command.emplace_back(argument);
  return command;
}

}  // namespace

TEST_CASE("integrate gives the reference joints of example 5.1 in at most four updates per step",
          "[end_to_end]") {
  Sandbox sandbox;
  for (const Sample& sample : samples) {
    CAPTURE(sample.integrator, sample.alpha, sample.solver, sample.duration);
    const Json result = test::run_json(sandbox, command_of(sample));
    CHECK(result["outcome"] == "completed");
    CHECK(result["solver"]["updates_max"].get<int>() <= 4);
    REQUIRE(result["q"].size() == 3);
    for (std::size_t i = 0; i < 3; ++i)
      CHECK(std::abs(result["q"][i].get<double>() - sample.q[i]) < 1e-8);
  }
}

TEST_CASE("hamel-variational keeps the energy of example 5.1 within 1.8e-4 J over 100 s",
          "[end_to_end]") {
  Sandbox sandbox;
  const Json result =
      test::run_json(sandbox, {"integrate", "data/robots/planar3.json", "--integrator",
                               "hamel-variational", "--step", "0.01", "--duration", "100"});
  CHECK(result["steps"] == 10000);
  CHECK(result["energy_error_max_J"].get<double>() <= 1.8e-4);
  CHECK(result["energy_error_max_J"].get<double>() > 1e-5);  // of second order, not exact
}

TEST_CASE("chains from make-chain validate and move", "[end_to_end]") {
  Sandbox sandbox;
  for (const int links : {3, 20}) {
    CAPTURE(links);
    const auto file = fmt::format("chain{}.json", links);
    REQUIRE(sandbox
                .run({"robot", "make-chain", "--links", std::to_string(links), "--axes", "x,z,x",
                      "-o", file})
                .exit_code == 0);
    CHECK(sandbox.run({"validate", file}).exit_code == 0);
    const Json info = test::run_json(sandbox, {"robot", "info", file});
    CHECK(info.is_object());
    const Json result = test::run_json(sandbox, {"integrate", file, "--duration", "0.1"});
    CHECK(result["q"].size() == static_cast<std::size_t>(links));
    CHECK(std::abs(result["q"][0].get<double>()) > 0.01);  // it fell
    CHECK(result["solver"]["updates_max"].get<int>() <= 3);
    CHECK(result["energy_error_max_J"].get<double>() < 1e-3);
  }
}

TEST_CASE("integrate notes which parts of a scene it ignores", "[end_to_end]") {
  Sandbox sandbox;
  const auto output = sandbox.run({"integrate", "data/scenes/shelf.json", "--duration", "0.01"});
  CHECK(output.exit_code == 0);
  CHECK_THAT(output.err, Catch::Contains("note: ") && Catch::Contains("planner 'hybrid'") &&
                             Catch::Contains("the map") && Catch::Contains("goal(s)"));
}

TEST_CASE("options of the published schemes have no effect with others, which integrate notes",
          "[end_to_end]") {
  Sandbox sandbox;
  const std::vector<std::string> plain{"integrate", "data/robots/planar3.json", "--duration", "0.1",
                                       "--json"};
  std::vector<std::string> flagged = plain;
  for (const char* flag : {"--alpha", "0.25", "--start", "published"}) flagged.emplace_back(flag);
  const auto output = sandbox.run(flagged);
  CHECK(output.exit_code == 0);
  CHECK_THAT(output.err,
             Catch::Contains("--alpha: has no effect with integrator 'hamel-variational'") &&
                 Catch::Contains("--start: has no effect with integrator 'hamel-variational'"));
  CHECK(Json::parse(output.out)["q"] == Json::parse(sandbox.run(plain).out)["q"]);
}
