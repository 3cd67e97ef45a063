#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <catch2/catch.hpp>
#include <memory>

#include "decode.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/distance.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using test::Decoded;
using test::triple;
using test::vector_of;

namespace {

// T_i = exp(S_1 q_1) … exp(S_i q_i) as the README defines it, from the data alone.
std::vector<geometry::SE3> poses(const Json& robot, const Eigen::VectorXd& q) {
  std::vector<geometry::SE3> T;
  geometry::SE3 now;
  for (std::size_t i = 0; i < robot["joints"].size(); ++i) {
    const Eigen::VectorXd screw = vector_of(robot["joints"][i]["screw"]);
    now = now * geometry::SE3::exp(screw * q[static_cast<Eigen::Index>(i)]);
    T.push_back(now);
  }
  return T;
}

geometry::SE3 pose_of(const Json& pose) {
  return {geometry::rotation_from_wxyz(vector_of(pose["quaternion_wxyz"])),
          vector_of(pose["position_m"])};
}

Eigen::VectorXd q_of(const std::vector<double>& q, std::size_t frame, int dof) {
  return Eigen::VectorXd::Map(&q.at(frame * static_cast<std::size_t>(dof)), dof);
}

}  // namespace

TEST_CASE("the poses are evenly spaced ticks of the log, including the first and the last",
          "[report]") {
  const auto log = test::scratch("frames") / "run.jsonl";
  (void)test::log_run(test::shelf(0.5), log);
  const auto ticks = test::ticks_of(log);
  for (const std::size_t most : {2UL, 3UL, 100UL, 2000UL}) {
    const auto data = report::make_data({log}, {most, 1500});
    const Decoded page(data.bytes);
    const Json& frames = page.head["runs"][0]["frames"];
    const auto t = page(frames["t"]), q = page(frames["q"]), goal = page(frames["goal_index"]);
    REQUIRE(t.size() <= most);
    REQUIRE(t.size() >= std::min(most / 2, ticks.size()));
    REQUIRE(q.size() == 7 * t.size());
    CHECK(data.runs.at(0).frames == t.size());
    CHECK(data.runs.at(0).ticks == ticks.size());
    std::size_t at = 0;
    std::vector<std::size_t> chosen;
    for (std::size_t f = 0; f < t.size(); ++f) {
      while (at < ticks.size() && ticks[at]["time_s"].get<double>() < t[f] - 1e-9) ++at;
      REQUIRE(at < ticks.size());
      REQUIRE(ticks[at]["time_s"].get<double>() == t[f]);
      REQUIRE((vector_of(ticks[at]["q"]) - q_of(q, f, 7)).lpNorm<Eigen::Infinity>() <= 0.51e-6);
      REQUIRE(goal[f] == ticks[at]["goal_index"].get<double>());
      chosen.push_back(at);
    }
    CHECK(chosen.front() == 0);
    CHECK(chosen.back() == ticks.size() - 1);
    for (std::size_t f = 2; f + 1 < chosen.size(); ++f)
      REQUIRE(chosen[f] - chosen[f - 1] == chosen[1] - chosen[0]);
  }
}

TEST_CASE("the kinematics of the page put spheres, tip and skeleton where the model has them",
          "[report]") {
  const auto folder = test::scratch("kinematics");
  scene::Scene scene = test::shelf(0.01);
  scene::Payload payload;
  payload.mass_kg = 1.0;
  payload.position_m = {0.01, 0.02, 0.05};
  payload.inertia_kg_m2 = 0.01 * Eigen::Matrix3d::Identity();
  scene.model.payload = payload;
  scene::Scene planar = scene::read_scene(test::checkout("data/scenes/paper_51.json"));
  planar.base = geometry::SE3(
      Eigen::AngleAxisd(0.3, Vector3d(1, 2, 3).normalized()).toRotationMatrix(), {1, 2, 3});
  planar.duration_s = planar.step_s;
  (void)test::log_run(scene, folder / "arm.jsonl");
  (void)test::log_run(planar, folder / "planar.jsonl");
  const Decoded page(report::make_data({folder / "arm.jsonl", folder / "planar.jsonl"}).bytes);
  REQUIRE(page.head["worlds"].size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    const Json& robot = page.head["worlds"][i]["robot"];
    const model::Model model = control::load_model(i == 0 ? scene : planar);
    const geometry::SE3 base = pose_of(robot["base"]);
    dynamics::Workspace ws(model);
    const Eigen::VectorXd q = Eigen::VectorXd::LinSpaced(model.dof(), -1.2, 1.7);
    const auto T = poses(robot, q);
    const auto place = [&](const Json& link, const Json& point) -> Vector3d {
      return base * (T.at(link.get<std::size_t>()) * Vector3d(vector_of(point)));
    };
    dynamics::forward_kinematics(model, ws, q);
    std::vector<Vector3d> centers(model.shapes().size());
    dynamics::shape_centers(model, ws, centers);
    REQUIRE(robot["spheres"].size() == centers.size());
    for (std::size_t s = 0; s < centers.size(); ++s) {
      REQUIRE((place(robot["spheres"][s]["link"], robot["spheres"][s]["center_m"]) - centers[s])
                  .norm() < 1e-12);
      REQUIRE(robot["spheres"][s]["radius_m"] == model.shapes()[s].radius);
    }
    const auto& links = model.robot().links;
    std::size_t segments = 0;
    for (std::size_t k = 0; k < links.size(); ++k)
      for (const auto& segment : links[k].segments) {
        const Json& drawn = robot["segments"].at(segments++);
        const auto at = [&](const Vector3d& p) {
          return dynamics::point_position(model, ws, static_cast<int>(k), p);
        };
        REQUIRE((place(drawn["link"], drawn["from_m"]) - at(segment.from_m)).norm() < 1e-12);
        REQUIRE((place(drawn["link"], drawn["to_m"]) - at(segment.to_m)).norm() < 1e-12);
      }
    CHECK(robot["segments"].size() == segments);
    const Json& skeleton = robot["skeleton"];
    REQUIRE(skeleton.size() == links.size() + 1);
    CHECK((place(robot["tip_link"], skeleton.back()) - dynamics::tip_pose(model, ws).p()).norm() <
          1e-12);
    // A point on the axis of a joint belongs to both links of the joint.
    for (std::size_t k = 1; k < links.size(); ++k)
      REQUIRE((place(k, skeleton[k]) - place(k - 1, skeleton[k])).norm() < 1e-12);
    if (model.planar())
      CHECK((vector_of(robot["planar_normal"]) - model.root().R().col(2)).norm() < 1e-12);
    else
      CHECK(robot["planar_normal"].is_null());
  }
}

TEST_CASE("remarks are notes and events of the page", "[report]") {
  const auto log = test::scratch("remarks") / "run.jsonl";
  (void)test::log_run(test::shelf(0.05), log);
  report::Options options;
  options.remarks = {{0.02, "the judge saw <hand> touch it"}};
  const Json plain = Decoded(report::make_data({log}).bytes).head["runs"][0];
  const Json run = Decoded(report::make_data({log}, options).bytes).head["runs"][0];
  REQUIRE(run["events"].size() == plain["events"].size() + 1);
  CHECK(run["events"].back() == Json{{"t", 0.02}, {"text", "the judge saw <hand> touch it"}});
  CHECK(run["notes"].size() == plain["notes"].size() + 1);
  CHECK(run["notes"].back() == "the judge saw <hand> touch it");
}

TEST_CASE("skeletons follow the links of their arms", "[report]") {
  const auto folder = test::scratch("skeleton");
  scene::Scene scene = scene::read_scene(test::checkout("data/scenes/paper_52_hybrid.json"));
  scene.planner.reset();
  scene.duration_s = scene.step_s;
  (void)test::log_run(scene, folder / "planar.jsonl");
  (void)test::log_run(test::shelf(0.01), folder / "arm.jsonl");
  const Decoded page(report::make_data({folder / "planar.jsonl", folder / "arm.jsonl"}).bytes);
  const Json& planar = page.head["worlds"][0]["robot"]["skeleton"];
  for (std::size_t i = 0; i <= 4; ++i)
    CHECK((vector_of(planar[i]) - Vector3d(static_cast<double>(i), 0, 0)).norm() < 1e-12);
  // By the joint origins in the URDF, the elbow is 82.5 mm in front of the line from shoulder to
  // wrist.
  const Json& arm = page.head["worlds"][1]["robot"]["skeleton"];
  CHECK((vector_of(arm[1]) - Vector3d(0, 0, 0.333)).norm() < 1e-9);
  CHECK((vector_of(arm[3]) - Vector3d(0.0825, 0, 0.649)).norm() < 1e-9);
  CHECK((vector_of(arm[5]) - Vector3d(0, 0, 1.033)).norm() < 1e-9);
}

TEST_CASE("clearances and closest points belong to the cells that the page shows", "[report]") {
  const auto log = test::scratch("clearance") / "run.jsonl";
  (void)test::log_run(test::shelf(2.5), log);
  const Decoded page(report::make_data({log}, {20, 100}).bytes);
  const Json &world = page.head["worlds"][0], &robot = world["robot"],
             &frames = page.head["runs"][0]["frames"];
  CHECK(world["map"]["left_out"] == 0);
  const auto lo = page(world["map"]["lo"]), level = page(world["map"]["level"]);
  const geometry::SE3 base = pose_of(robot["base"]), map = pose_of(world["map"]);
  const double resolution = world["map"]["resolution_m"], influence = frames["influence_m"];
  std::vector<scene::Box> boxes;
  for (std::size_t c = 0; c < level.size(); ++c) {
    const Vector3d corner = triple(lo, c);
    boxes.push_back(
        {corner * resolution, (corner + Vector3d::Constant(std::exp2(level[c]))) * resolution});
  }
  const auto q = page(frames["q"]), clearance = page(frames["clearance"]),
             points = page(frames["contacts"]["points"]);
  const auto count = page(frames["contacts"]["count"]);
  const std::size_t spheres = robot["spheres"].size();
  REQUIRE(clearance.size() == count.size() * spheres);
  std::size_t near = 0, contact = 0;
  for (std::size_t f = 0; f < count.size(); ++f) {
    const auto T = poses(robot, q_of(q, f, 7));
    std::vector<double> distances;
    for (std::size_t s = 0; s < spheres; ++s) {
      const Json& sphere = robot["spheres"][s];
      const Vector3d center = map.inverse() * (base * (T.at(sphere["link"].get<std::size_t>()) *
                                                       Vector3d(vector_of(sphere["center_m"]))));
      double distance = std::numeric_limits<double>::infinity();
      for (const auto& box : boxes)
        distance = std::min(distance, scene::closest_on_box(center, box).distance -
                                          sphere["radius_m"].get<double>());
      const double stored = clearance[f * spheres + s];
      if (distance > influence + 1e-4) {
        REQUIRE(std::isnan(stored));
      } else if (distance < influence - 1e-4) {
        REQUIRE(std::abs(stored - distance) < 0.6e-4);  // steps of 0.1 mm, q rounded to 1e-6
        ++near;
      }
      if (!std::isnan(stored)) distances.push_back(stored);
    }
    std::sort(distances.begin(), distances.end());
    REQUIRE(count[f] == static_cast<double>(std::min<std::size_t>(6, distances.size())));
    for (std::size_t c = 0; c < static_cast<std::size_t>(count[f]); ++c, ++contact)
      REQUIRE(std::abs((triple(points, 2 * contact) - triple(points, 2 * contact + 1)).norm() -
                       distances[c]) < 4e-4);
  }
  CHECK(near > 100);
  CHECK(points.size() == 6 * contact);
}

TEST_CASE(
    "a force at the tip is its channel's torque mapped by the damped operational-space inertia",
    "[report]") {
  const auto log = test::scratch("forces") / "run.jsonl";
  scene::Scene scene = test::shelf(0.6);
  scene.actuation.type = scene::ActuationType::ideal;  // which keeps the channels apart
  (void)test::log_run(scene, log);
  const Decoded page(report::make_data({log}).bytes);
  const Json& frames = page.head["runs"][0]["frames"];
  const auto ticks = test::ticks_of(log);
  const auto t = page(frames["t"]);
  REQUIRE(t.size() == ticks.size());
  const model::Model model = control::load_model(scene);
  dynamics::Workspace ws(model);
  REQUIRE(frames["forces"].size() >= 2);
  for (const Json& channel : frames["forces"]) {
    const auto f = page(channel["f"]);
    for (std::size_t k = 0; k + 1 < ticks.size(); k += 50) {
      const Eigen::VectorXd q = vector_of(ticks[k]["q"]);
      Vector3d expected = Vector3d::Zero();
      if (const auto& torques = ticks[k]["channels"]; torques.contains(channel["channel"])) {
        Eigen::MatrixXd M(7, 7);
        dynamics::mass_matrix(model, ws, q, M);
        dynamics::forward_kinematics(model, ws, q);
        dynamics::Matrix3Xd J(3, 7);
        dynamics::point_jacobian(model, ws, model.robot().tip.link,
                                 dynamics::tip_pose(model, ws).p(), J);
        const Eigen::MatrixXd inverse = M.inverse();
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(J * inverse * J.transpose());
        const Vector3d d = eigen.eigenvalues();
        const Vector3d damped = (d.array() / (d.array().square() + 1e-6)).matrix();
        expected = eigen.eigenvectors() * damped.asDiagonal() * eigen.eigenvectors().transpose() *
                   (J * inverse * vector_of(torques[channel["channel"]]));
      }
      CAPTURE(channel["channel"], k);
      REQUIRE((triple(f, k) - expected).norm() <= 2e-3 * expected.norm() + 1e-12);  // 10 bits
    }
  }
}

TEST_CASE("binned lines keep the smallest and largest value of every bin, in their order in time",
          "[report]") {
  const auto log = test::scratch("bins") / "run.jsonl";
  scene::Scene scene = scene::read_scene(test::checkout("data/scenes/paper_51.json"));
  scene.step_s = 0.002;
  scene.duration_s = 6.0;
  (void)test::log_run(scene, log);
  const auto ticks = test::ticks_of(log);
  REQUIRE(ticks.size() == 3001);
  for (const std::size_t most : {4UL, 101UL, 1500UL, 5000UL}) {
    const Decoded page(report::make_data({log}, {2, most}).bytes);
    const Json& plot = page.plot(0, "v");
    const auto t = page(plot["t"]);
    REQUIRE(t.size() <= most);
    REQUIRE(t.size() >= std::min(ticks.size(), most / 4));
    for (std::size_t joint = 0; joint < 3; ++joint) {
      const Json& packed = plot["series"][joint]["y"];
      const auto y = page(packed);
      REQUIRE(y.size() == t.size());
      const double level = packed["scale"];
      const auto value = [&](std::size_t k) { return ticks[k]["v"][joint].get<double>(); };
      std::size_t k = 0;
      for (std::size_t p = 0; p < t.size();) {
        REQUIRE(ticks[k]["time_s"].get<double>() == Approx(t[p]).margin(1e-12));
        const bool single = most == 5000 || p + 1 == t.size();
        const double end = single ? t[p] : t[p + 1];
        std::size_t lo = k, hi = k;
        for (; k < ticks.size() && ticks[k]["time_s"].get<double>() <= end + 1e-9; ++k) {
          if (value(k) < value(lo)) lo = k;
          if (value(k) > value(hi)) hi = k;
        }
        const bool rising = lo <= hi;
        REQUIRE(std::abs(y[p] - value(rising ? lo : hi)) <= 0.51 * level);
        if (!single) REQUIRE(std::abs(y[p + 1] - value(rising ? hi : lo)) <= 0.51 * level);
        p += single ? 1 : 2;
      }
      CHECK(k == ticks.size());
    }
  }
}

TEST_CASE(
    "the plotted energy error has the maximum in the result, with all ticks and with every tenth",
    "[report]") {
  const auto folder = test::scratch("energy");
  for (const long every : {1L, 10L}) {
    for (const std::string name : {"shelf", "free", "potential"}) {
      scene::Scene scene = test::shelf(1.0);
      if (name == "free") scene.planner.reset();
      if (name == "potential")
        scene.planner = scene::Choice{
            "apf",
            {{"algorithm", "published"}, {"mapping", "potential"}, {"gravity_compensation", true}}};
      const auto log = folder / (name + ".jsonl");
      const auto result = test::log_run(scene, log, every);
      const Decoded page(report::make_data({log}).bytes);
      const auto error = page(page.plot(0, "energy_error")["series"][0]["y"]);
      double largest = 0.0;
      for (const double e : error) largest = std::isnan(e) ? largest : std::max(largest, e);
      CAPTURE(name, every);
      REQUIRE(result.energy_error_max_J > 0.0);
      CHECK(largest == Approx(result.energy_error_max_J).epsilon(1e-3));
      CHECK(page.head["runs"][0]["notes"].size() == (every > 1 ? 1U : 0U));
    }
  }
}

TEST_CASE("runs of one scene share a world and have different names", "[report]") {
  const auto folder = test::scratch("worlds");
  scene::Scene scene = test::shelf(0.02);
  (void)test::log_run(scene, folder / "a.jsonl");
  (void)test::log_run(scene, folder / "b.jsonl.zst");
  scene.goals.resize(1);
  (void)test::log_run(scene, folder / "c.jsonl");
  scene.planner.reset();
  (void)test::log_run(scene, folder / "free.jsonl");
  const auto data =
      report::make_data({folder / "a.jsonl", folder / "b.jsonl.zst", folder / "c.jsonl",
                         folder / "free.jsonl", folder / "a.jsonl"});
  const Decoded page(data.bytes);
  CHECK(page.head["format"] == "hamelin.report/1");
  CHECK(page.head["title"] == "shelf.json");
  CHECK(page.head["worlds"].size() == 3);
  std::vector<int> worlds;
  std::vector<std::string> names;
  for (const Json& run : page.head["runs"]) {
    worlds.push_back(run["world"]);
    names.push_back(run["name"]);
  }
  CHECK(worlds == std::vector<int>{0, 0, 1, 2, 0});
  CHECK(names == std::vector<std::string>{"hybrid a #1", "hybrid b.jsonl", "hybrid c",
                                          "hamel-variational", "hybrid a #5"});
  CHECK(page.head["runs"][0]["frames"]["q"] == page.head["runs"][4]["frames"]["q"]);  // stored once
  CHECK(page.head["runs"][0]["result"]["outcome"] == "timeout");
  CHECK(page.head["runs"][0]["config"]["planner"]["name"] == "hybrid");
}

TEST_CASE("the integrator is that of the plant", "[report]") {
  const auto folder = test::scratch("integrator");
  (void)test::log_run(test::shelf(0.02), folder / "own.jsonl");
  std::string text = read_file(folder / "own.jsonl");
  const std::string own = R"("integrator":"hamel-variational")";
  text.replace(text.rfind(own), own.size(), R"("integrator":"mujoco-euler")");  // in the result
  std::ofstream(folder / "other.jsonl", std::ios::binary) << text;
  const Decoded page(report::make_data({folder / "own.jsonl", folder / "other.jsonl"}).bytes);
  CHECK(page.head["runs"][0]["integrator"] == "hamel-variational");
  CHECK(page.head["runs"][1]["integrator"] == "mujoco-euler");
}

TEST_CASE("equal inputs give equal bytes", "[report]") {
  const auto folder = test::scratch("same");
  (void)test::log_run(test::shelf(0.1), folder / "a.jsonl");
  const std::string data = report::make_data({folder / "a.jsonl"}).bytes;
  CHECK(report::make_data({folder / "a.jsonl"}).bytes == data);
  const std::string page = "<x>" + std::string(report::token) + "</x>";
  CHECK(report::make_page(page, data, "t") == report::make_page(page, data, "t"));
}

TEST_CASE("the planner's own series are plotted, one plot for each unit", "[report]") {
  const auto folder = test::scratch("series");
  (void)test::log_run(test::shelf(0.2), folder / "plain.jsonl");
  std::string text;
  for (Json line : log::read_log(folder / "plain.jsonl").lines) {
    if (line["type"] == "header")
      line["series"] = Json::parse(R"([{"name": "a", "unit": "m"}, {"name": "b", "unit": ""},
                                       {"name": "c", "unit": "m"}])");
    if (line["type"] == "tick" && line.contains("channels")) {
      const double k = line["k"].get<double>();
      line["series"] = {k, nullptr, -k};
      if (k == 7.0) line["series"][1] = 5.0;
    }
    text += line.dump() + "\n";
  }
  write_file_atomically(folder / "series.jsonl", text);
  const auto data = report::make_data({folder / "series.jsonl"}, {100, 1500});
  const Decoded page(data.bytes);
  const Json& metres = page.plot(0, "series m");
  REQUIRE(metres["series"].size() == 2);
  CHECK(metres["series"][0]["label"] == "a");
  CHECK(metres["series"][1]["label"] == "c");
  const auto a = page(metres["series"][0]["y"]), c = page(metres["series"][1]["y"]);
  REQUIRE(a.size() > 40);
  for (std::size_t i = 0; i + 1 < a.size(); ++i) {
    CHECK(a[i] == Approx(static_cast<double>(i)).margin(0.01));
    CHECK(c[i] == Approx(-static_cast<double>(i)).margin(0.01));
  }
  const auto b = page(page.plot(0, "series ")["series"][0]["y"]);
  CHECK(b[7] == 5.0);
  CHECK(std::isnan(b[6]));

  text.replace(text.find("\"series\":[1.0,null,-1.0]"), 24, "\"series\":[1.0,null]");
  write_file_atomically(folder / "short.jsonl", text);
  CHECK_THROWS_WITH((void)report::make_data({folder / "short.jsonl"}, {100, 1500}),
                    Catch::Contains("series: expected 3 numbers, one per series"));
}

TEST_CASE("the target that is followed is that of the ticks", "[report]") {
  const auto log = test::scratch("target") / "run.jsonl";
  scene::Scene scene =
      scene::read_scene(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes/follow.json");
  scene.duration_s = 0.5;
  (void)test::log_run(scene, log);
  const auto ticks = test::ticks_of(log);
  const Decoded page(report::make_data({log}, {2000, 1500}).bytes);
  const Json& frames = page.head["runs"][0]["frames"];
  const auto t = page(frames["t"]), target = page(frames["target"]);
  REQUIRE(t.size() == ticks.size());
  REQUIRE(target.size() == 3 * t.size());
  for (std::size_t f = 0; f < t.size(); ++f)
    REQUIRE((Vector3d::Map(&target[3 * f]) - vector_of(ticks[f]["target"]["position_m"])).norm() <
            1e-4);
  CHECK(page.head["worlds"][0]["goals"].empty());
  (void)test::log_run(test::shelf(0.1), log);
  CHECK(Decoded(report::make_data({log}).bytes).head["runs"][0]["frames"]["target"].is_null());
}

TEST_CASE("the distance from a trajectory and the shares of torque limits are those of the ticks",
          "[report]") {
  const auto log = test::scratch("trajectory") / "run.jsonl";
  scene::Scene scene =
      scene::read_scene(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes/pillar.json");
  scene::JointTrajectory trajectory;
  trajectory.time_s = Eigen::Vector2d(0.0, 1.0);
  trajectory.q = scene.start_q.replicate(1, 2);
  trajectory.q(0, 1) += 0.4;
  trajectory.v = Eigen::MatrixXd::Zero(7, 2);
  scene.goals = {scene::trajectory_goal(trajectory)};
  scene.duration_s = 0.5;
  scene.actuation.type = scene::ActuationType::sampled;
  scene.actuation.control_period_s = scene.step_s;
  (void)test::log_run(scene, log);
  const auto ticks = test::ticks_of(log);
  const Decoded page(report::make_data({log}, {2000, 1500}).bytes);
  const auto distance = page(page.plot(0, "trajectory")["series"][0]["y"]);
  const Json& shares = page.plot(0, "tau_share");
  REQUIRE(shares["series"].size() == 7);
  CHECK(shares["marks"].size() == 2);
  const auto second = page(shares["series"][1]["y"]);
  const model::Model arm = control::load_model(scene);
  REQUIRE(distance.size() == ticks.size());
  for (std::size_t f = 0; f < ticks.size(); ++f) {
    const double expected = (vector_of(ticks[f]["q"]) - vector_of(ticks[f]["reference"]["q"]))
                                .lpNorm<Eigen::Infinity>();
    CHECK(distance[f] == Approx(expected).margin(1e-6));
    CHECK(second[f] ==
          Approx(ticks[f]["tau"][1].get<double>() / *arm.robot().links[1].joint.effort_max)
              .margin(1e-3));
  }
  (void)test::log_run(test::shelf(0.1), log);
  const Decoded other(report::make_data({log}).bytes);
  for (const Json& plot : other.head["runs"][0]["plots"]) CHECK(plot["id"] != "tau_share");
}

TEST_CASE("the stops are those of the ticks", "[report]") {
  const auto folder = test::scratch("stops");
  scene::Scene scene = test::shelf(4.0);
  scene.planner->name = "apf";
  scene.planner->params = Json{{"algorithm", "published"}};  // the shield stops it often
  (void)test::log_run(scene, folder / "run.jsonl");
  struct Stop {
    double t, until;
    Json cause, q, q_end;
  };
  std::vector<Stop> expected;
  bool goes_on = false;
  for (const Json& tick : test::ticks_of(folder / "run.jsonl")) {
    const double t = tick["time_s"];
    if (goes_on) expected.back().until = t;
    const bool stops = tick.contains("stop") && !tick["stop"].is_null();
    if (stops && !(goes_on && expected.back().q_end == tick["stop"]["q_end"]))
      expected.push_back({t, t, tick["stop"]["cause"], tick["q"], tick["stop"]["q_end"]});
    goes_on = stops;
  }
  REQUIRE(expected.size() > 3);
  REQUIRE(expected.size() < 500);
  const Decoded page(report::make_data({folder / "run.jsonl"}).bytes);
  const Json& stops = page.head["runs"][0]["stops"];
  REQUIRE(stops.size() == expected.size());
  for (std::size_t i = 0; i < stops.size(); ++i) {
    CHECK(stops[i]["t"] == expected[i].t);
    CHECK(stops[i]["until"] == expected[i].until);
    CHECK(stops[i]["cause"] == expected[i].cause);
    for (const char* key : {"q", "q_end"}) {
      const Json& exact = std::string_view(key) == "q" ? expected[i].q : expected[i].q_end;
      CHECK((vector_of(stops[i][key]) - vector_of(exact)).lpNorm<Eigen::Infinity>() <= 0.51e-6);
    }
  }
}

TEST_CASE("obstacles on way-points and in moving frames have the poses that the scene gives them",
          "[report]") {
  const auto folder = test::scratch("movers");
  scene::Scene scene = test::shelf(0.3);
  const auto add = [&](const char* name, scene::Shape shape) -> scene::Obstacle& {
    scene::Obstacle& o = scene.obstacles.emplace_back();
    o.name = name;
    o.shape = shape;
    o.radius_m = 0.05;
    o.length_m = 0.2;
    o.pose = {Eigen::Matrix3d::Identity(), {5.0, 0.0, 0.0}};
    return o;
  };
  const std::vector<scene::Waypoint> points{
      {0.0, {0.0, 0.0, 0.0}},
      {0.1, {0.2, 0.0, 0.1}, {std::cos(0.4), 0.0, 0.0, std::sin(0.4)}},
      {0.3, {0.1, 0.3, 0.0}, {std::cos(0.7), std::sin(0.7), 0.0, 0.0}}};
  const scene::WaypointMotion motion{
      std::make_shared<scene::WaypointPath>(points, scene::WaypointPath::Options(), "points")};
  scene.obstacles.clear();
  add("frame", scene::Shape::frame).motion = motion;
  add("attached", scene::Shape::capsule).attached_to = "frame";
  add("alone", scene::Shape::sphere).motion = motion;
  add("swinging", scene::Shape::sphere).motion = scene::SineMotion{{0.0, 0.1, 0.0}, 1.0};
  scene::attach(scene.obstacles, "scene");
  (void)test::log_run(scene, folder / "run.jsonl");
  scene.duration_s = 0.2;
  (void)test::log_run(scene, folder / "shorter.jsonl");
  const Decoded page(report::make_data({folder / "run.jsonl", folder / "shorter.jsonl"}).bytes);
  REQUIRE(page.head["worlds"].size() == 2);  // samples end with the scene
  const Json& drawn = page.head["worlds"][0]["obstacles"];
  REQUIRE(drawn.size() == 3);  // without the frame
  for (std::size_t i = 0; i < 2; ++i) {
    const scene::Obstacle& o = scene.obstacles[i + 1];
    CHECK(drawn[i]["name"] == o.name);
    CHECK(drawn[i]["shape"] == scene::to_string(o.shape));
    CHECK(drawn[i]["motion"].is_null());
    const Json& poses = drawn[i]["poses"];
    const auto t = page(poses["t"]), p = page(poses["position_m"]),
               q = page(poses["quaternion_wxyz"]);
    REQUIRE(t.size() == 16);
    CHECK(t.back() == Approx(0.3));
    REQUIRE(q.size() == 4 * t.size());
    for (std::size_t k = 0; k < t.size(); ++k) {
      const geometry::SE3 pose = scene::motion_at(o, t[k]).pose;
      CHECK((triple(p, k) - pose.p()).norm() < 1e-5);
      const Eigen::Quaterniond turn(q[4 * k], q[4 * k + 1], q[4 * k + 2], q[4 * k + 3]);
      CHECK((turn.normalized().toRotationMatrix() - pose.R()).norm() < 1e-4);
    }
  }
  CHECK(drawn[0]["length_m"] == 0.2);
  CHECK(drawn[2]["poses"].is_null());
  CHECK(drawn[2]["motion"]["type"] == "sine");
}

TEST_CASE("movers are predicted to be where the scene's predictions put them", "[report]") {
  const auto folder = test::scratch("predicted");
  scene::Scene scene = test::shelf(0.3);
  scene.obstacles.clear();
  const auto add = [&](const char* name, scene::Prediction prediction) -> scene::Obstacle& {
    scene::Obstacle& o = scene.obstacles.emplace_back();
    o.name = name;
    o.shape = scene::Shape::capsule;
    o.radius_m = 0.05;
    o.length_m = 0.2;
    o.pose = {Eigen::Matrix3d::Identity(), {5.0, 0.0, 0.0}};
    o.motion = scene::SineMotion{{0.0, 0.1, 0.0}, 1.0};
    o.prediction = prediction;
    return o;
  };
  const std::vector<scene::Waypoint> points{
      {0.0, {0.0, 0.0, 0.0}},
      {0.5, {0.2, 0.0, 0.1}, {std::cos(0.4), 0.0, 0.0, std::sin(0.4)}},
      {1.3, {0.1, 0.3, 0.0}, {std::cos(0.7), std::sin(0.7), 0.0, 0.0}}};
  using scene::Prediction;
  add("turning", Prediction::path).motion = scene::WaypointMotion{
      std::make_shared<scene::WaypointPath>(points, scene::WaypointPath::Options(), "points")};
  add("accelerated", Prediction::constant_acceleration);
  add("straight", Prediction::constant_velocity);
  add("bounded", Prediction::speed_bound).speed_max_m_s = 1.5;
  add("late", Prediction::path).known = false;
  scene.obstacles.back().visible_within_m = 0.1;
  add("resting", Prediction::path).motion.reset();
  add("never seen", Prediction::path).known = false;
  add("of the judge", Prediction::path).judge_only = true;
  (void)test::log_run(scene, folder / "run.jsonl");
  const Decoded page(report::make_data({folder / "run.jsonl"}).bytes);
  const Json& drawn = page.head["worlds"][0]["obstacles"];
  REQUIRE(drawn.size() == 8);
  for (std::size_t i = 0; i < 5; ++i) {
    const scene::Obstacle& o = scene.obstacles[i];
    CAPTURE(o.name);
    const Json& predicted = drawn[i]["predicted"];
    REQUIRE(predicted.is_object());
    CHECK(predicted["type"] == scene::to_string(o.prediction));
    const Json& ahead = predicted["ahead_s"];
    const auto t = page(predicted["t"]), p = page(predicted["position_m"]);
    CHECK(t.front() == 0.0);
    CHECK(t.back() == Approx(0.3));
    REQUIRE(p.size() == 3 * t.size() * ahead.size());
    REQUIRE(predicted["nearer_m"].size() == ahead.size());
    // Only what turns has rotations.
    REQUIRE(predicted["quaternion_wxyz"].is_null() == (i != 0));
    const auto q = i == 0 ? page(predicted["quaternion_wxyz"]) : std::vector<double>();
    for (std::size_t k = 0; k < t.size(); ++k)
      for (std::size_t a = 0; a < ahead.size(); ++a) {
        const scene::Placed placed = scene::placed_at(o, {t[k], ahead[a].get<double>()});
        const std::size_t at = ahead.size() * k + a;
        REQUIRE((triple(p, at) - placed.pose.p()).norm() < 4e-4);
        CHECK(predicted["nearer_m"][a] == placed.nearer_m);
        if (q.empty()) continue;
        const Eigen::Quaterniond turn(q[4 * at], q[4 * at + 1], q[4 * at + 2], q[4 * at + 3]);
        REQUIRE((turn.normalized().toRotationMatrix() - placed.pose.R()).norm() < 1e-3);
      }
  }
  // Nothing else is predicted for a planner.
  for (std::size_t i = 5; i < drawn.size(); ++i) CHECK(drawn[i]["predicted"].is_null());
}

TEST_CASE("the acts are those of the planner's series", "[report]") {
  const auto folder = test::scratch("acts");
  (void)test::log_run(test::shelf(0.1), folder / "plain.jsonl");
  // The number of the series at the first ticks; ticks without channels have no series.
  const std::vector<Json> numbers{0.0, 3.0, 3.0, 1.0, 2.0, 2.0, 0.0, 0.0, nullptr, 3.0, 4.0, 1.0};
  const auto with_series = [&](const char* name) {
    std::string text;
    std::size_t ticks = 0;
    for (Json line : log::read_log(folder / "plain.jsonl").lines) {
      if (line["type"] == "header") line["series"] = Json::array({{{"name", name}, {"unit", ""}}});
      if (line["type"] == "tick" && line.contains("channels"))
        line["series"] = Json::array({ticks < numbers.size() ? numbers[ticks++] : Json(0.0)});
      text += line.dump() + "\n";
    }
    write_file_atomically(folder / "acts.jsonl", text);
    return report::make_data({folder / "acts.jsonl"});
  };
  const auto ticks = test::ticks_of(folder / "plain.jsonl");
  const Decoded page(with_series("evasion").bytes);
  const Json& acts = page.head["runs"][0]["acts"];
  REQUIRE(acts.size() == 5);
  const auto check = [&](std::size_t i, const char* act, std::size_t from, std::size_t until) {
    CHECK(acts[i]["act"] == act);
    CHECK(acts[i]["t"] == ticks.at(from)["time_s"]);
    CHECK(acts[i]["until"] == ticks.at(until)["time_s"]);
  };
  check(0, "aside", 1, 3);
  check(1, "stop", 3, 4);
  check(2, "back", 4, 6);
  check(3, "aside", 9, 10);
  check(4, "stop", 11, 12);

  const Decoded other(with_series("fear").bytes);
  CHECK(other.head["runs"][0]["acts"].empty());
}

TEST_CASE("what the arm carries moves with the tip between its events", "[report]") {
  const auto log = test::scratch("loads") / "run.jsonl";
  scene::Scene scene = scene::read_scene(test::checkout("data/scenes/shelf_carry.json"));
  // attached and detached on the way
  scene.map.reset();
  scene.events.resize(2);
  for (auto& event : scene.events) event.map.reset();
  scene.events[0].goals_reached.reset();
  scene.events[0].time_s = 0.2;
  scene.events[1] = {};
  scene.events[1].time_s = 0.4;
  scene.events[1].detach = "can";
  scene.duration_s = 0.5;
  (void)test::log_run(scene, log);
  const Decoded page(report::make_data({log}).bytes);
  const Json &loads = page.head["runs"][0]["loads"], &robot = page.head["worlds"][0]["robot"];
  REQUIRE(loads.size() == 1);
  CHECK(loads[0]["name"] == "can");
  CHECK(loads[0]["t"] == Approx(0.201));
  CHECK(loads[0]["until"] == Approx(0.401));
  const Eigen::VectorXd q = vector_of(loads[0]["q_end"]);
  const model::Model model = control::load_model(scene);
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, q);
  const geometry::SE3 tip = dynamics::tip_pose(model, ws),
                      link = pose_of(robot["base"]) * poses(robot, q).back();
  const auto& capsule = scene.events[0].attach->capsules[0];
  const Json& balls = loads[0]["balls"];
  REQUIRE(balls.size() > scene.events[0].attach->capsules.size());
  CHECK(balls[0]["radius_m"] == capsule.radius_m);
  CHECK((link * Vector3d(vector_of(balls[0]["center_m"])) - tip * capsule.from_m).norm() < 1e-12);
}

TEST_CASE("the map of an arm that sees is what it has seen so far", "[report]") {
  const auto folder = test::scratch("seen");
  const auto log = folder / "run.jsonl";
  scene::Scene scene = scene::read_scene(test::checkout("data/scenes/shelf_seen.json"));
  scene.duration_s = 0.5;
  for (auto& sensor : scene.sensors) {
    sensor.width = 64;
    sensor.height = 48;
  }
  (void)test::log_run(scene, log);
  std::size_t voxels = 0, frames = 0;
  double last_s = 0.0;
  for (const Json& line : log::read_log(log).lines) {
    if (!line.contains("seen")) continue;
    ++frames;
    last_s = line["time_s"];
    for (const Json& run : line["seen"]) voxels += run[3].get<std::size_t>();
  }
  REQUIRE(frames >= 4);
  const Decoded page(report::make_data({log}).bytes);
  const Json& run = page.head["runs"][0];
  CHECK(run["events"].size() < frames);
  CHECK(run["seen"]["alone"] == true);
  const auto since = page(run["seen"]["since"]), lo = page(run["seen"]["lo"]);
  REQUIRE(since.size() == voxels);
  REQUIRE(lo.size() == 3 * voxels);
  CHECK(std::is_sorted(since.begin(), since.end()));
  CHECK(since.back() == last_s);
  // noise of 2 mm, voxels of 1 cm
  scene.map->known = true;
  const auto environment = scene::make_environment(scene, control::load_model(scene), 0.2);
  std::size_t off = 0;
  for (std::size_t i = 0; i < voxels; ++i) {
    const Vector3d p = 0.01 * (Vector3d(lo[3 * i], lo[3 * i + 1], lo[3 * i + 2]).array() + 0.5);
    scene::BoxHit hit;
    off += environment.map_field().nearest(p, 0.02, hit) ? 0 : 1;
  }
  CHECK(off == 0);

  std::string text = read_file(log);
  const std::size_t found = text.find(R"("seen":[[)");
  REQUIRE(found != std::string::npos);
  text.insert(found + 9, "99999,0,0,1],[");
  write_file_atomically(folder / "far.jsonl", text);
  CHECK_THROWS_WITH((void)report::make_data({folder / "far.jsonl"}),
                    Catch::Contains("seen: expected runs of voxels"));
}

TEST_CASE("the lines that a planner has drawn are those of the log", "[report]") {
  const auto folder = test::scratch("drawings");
  const auto log = folder / "run.jsonl";
  (void)test::log_run(test::shelf(0.05), log);
  std::string text = read_file(log);
  const std::string at = R"("k":10,)";
  const std::size_t found = text.find(at);
  REQUIRE(found != std::string::npos);
  text.insert(found + at.size(), R"("paths":[[0,0,0,0.1,0.2,0.3],[1,1,1]],)");
  write_file_atomically(folder / "drawn.jsonl", text);
  const Decoded page(report::make_data({folder / "drawn.jsonl"}).bytes);
  const Json& drawings = page.head["runs"][0]["drawings"];
  CHECK(page(drawings["t"]) == std::vector<double>{0.01});
  CHECK(page(drawings["lines"]) == std::vector<double>{2.0});
  CHECK(page(drawings["points"]) == std::vector<double>{2.0, 1.0});
  const auto points = page(drawings["position_m"]);
  REQUIRE(points.size() == 9);
  CHECK(std::abs(points[4] - 0.2) < 1e-4);
  CHECK(std::abs(points[8] - 1.0) < 1e-4);
  const Decoded without(report::make_data({log}).bytes);
  CHECK(without.head["runs"][0]["drawings"].is_null());
  text.replace(text.find("[1,1,1]"), 7, "[1,1]");
  write_file_atomically(folder / "drawn.jsonl", text);
  CHECK_THROWS_AS(report::make_data({folder / "drawn.jsonl"}), Error);
}
