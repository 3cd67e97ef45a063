// Prints how long ticks of the planner hybrid take at 1 kHz, without points and while another
// thread inserts 30 frames of 320 × 240 points per second into a map with voxels of 1 cm, or frames
// that are refused; and how long it takes from when a frame is there until the first tick that
// knows it.
//
//     hamelin_seeing_table [SECONDS]
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <limits>
#include <string>
#include <thread>

#include "hamelin/control/controller.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/sensing/depth_camera.hpp"

namespace {

using namespace hamelin;
using Clock = std::chrono::steady_clock;

constexpr double period_s = 0.001, frames_per_s = 30.0;

double ms_since(Clock::time_point from) {
  return std::chrono::duration<double, std::milli>(Clock::now() - from).count();
}

void print(const std::string& what, std::vector<double> ms) {
  std::sort(ms.begin(), ms.end());
  const auto at = [&](double share) {
    return ms[static_cast<std::size_t>(share * static_cast<double>(ms.size() - 1))];
  };
  fmt::print("{:<32}{:>8}{:>10.3f}{:>10.3f}{:>10.3f}\n", what, ms.size(), at(0.5), at(0.99),
             ms.back());
}

sensing::DepthRenderer::Solid wall(const Eigen::Vector3d& size, const Eigen::Vector3d& at) {
  sensing::DepthRenderer::Solid out;
  out.shape.shape = scene::Shape::box;
  out.shape.size_m = size;
  out.pose = {Eigen::Matrix3d::Identity(), at};
  return out;
}

// What a camera beside the shelf sees from places a little apart, with noise, in a room with a
// floor and walls.
std::vector<control::PointFrame> frames_of(const scene::Scene& scene, const model::Model& arm) {
  sensing::DepthRenderer renderer({.fov_rad = 1.2, .noise_m = 0.002});
  renderer.set_map(scene::make_environment(scene, arm, control::default_influence_m));
  const std::vector<sensing::DepthRenderer::Solid> room{
      wall({6.0, 6.0, 0.1}, {0.0, 0.0, -0.053}), wall({0.1, 6.0, 3.0}, {1.517, 0.0, 1.5}),
      wall({6.0, 0.1, 3.0}, {0.0, 1.513, 1.5}), wall({6.0, 0.1, 3.0}, {0.0, -1.516, 1.5})};
  Rng rng(1);
  std::vector<control::PointFrame> frames(10);
  for (control::PointFrame& frame : frames) {
    Eigen::Matrix3d R;
    R << 0, -0.6, 0.8, -1, 0, 0, 0, -0.8, -0.6;  // looks forward and down
    frame.sensor = {R, {-0.3 + rng.uniform(-0.02, 0.02), rng.uniform(-0.02, 0.02), 1.4}};
    frame.points = renderer.render(frame.sensor, room, rng);
    frame.range_m = 3.0;
  }
  return frames;
}

// Points that are not finite or too many, no points, times that are not known yet or no longer.
std::vector<control::PointFrame> bad_frames(const control::PointFrame& good) {
  std::vector<control::PointFrame> out(5, good);
  out[0].points(0, 1000) = std::numeric_limits<float>::quiet_NaN();
  out[1].points.resize(3, 0);
  out[2].time_s = 1.0;
  out[3].time_s = -1.0;
  out[4].points.setZero(3, 10'000'000);
  return out;
}

enum class Sees { nothing, frames, refused_frames };

std::string name_of(Sees sees) {
  if (sees == Sees::nothing) return "no frames";
  return sees == Sees::frames ? "frames" : "refused frames";
}

struct Seen {
  Clock::time_point there;
  std::uint64_t snapshot;
};

// Inserts frames at their rate until it is told to end; their times are relative to the clock.
class Camera {
 public:
  Camera(control::World& world, std::vector<control::PointFrame> frames,
         const std::atomic<double>& now_s)
      : world_(world), frames_(std::move(frames)), now_s_(now_s), thread_([this] { run(); }) {}
  ~Camera() { join(); }
  void join() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  [[nodiscard]] const std::vector<Seen>& seen() const { return seen_; }
  [[nodiscard]] const std::vector<double>& insert_ms() const { return insert_ms_; }

 private:
  void run() {
    std::vector<double> later_s;
    for (const control::PointFrame& frame : frames_) later_s.push_back(frame.time_s);
    auto next = Clock::now();
    for (std::size_t k = 0; !stop_; ++k) {
      control::PointFrame& frame = frames_[k % frames_.size()];
      frame.time_s = now_s_ + later_s[k % frames_.size()];
      insert(frame);
      next += std::chrono::microseconds(static_cast<long>(1e6 / frames_per_s));
      std::this_thread::sleep_until(next);
    }
  }

  void insert(const control::PointFrame& frame) {
    const auto there = Clock::now();
    try {
      const control::FrameReport report = world_.insert_points(frame);
      seen_.push_back({there, report.snapshot});
    } catch (const Error&) {
    }
    insert_ms_.push_back(ms_since(there));
  }

  control::World& world_;
  std::vector<control::PointFrame> frames_;
  const std::atomic<double>& now_s_;
  std::atomic<bool> stop_{false};
  std::vector<Seen> seen_;
  std::vector<double> insert_ms_;
  std::thread thread_;
};

void check_refused(const Camera& camera) {
  if (!camera.seen().empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{} bad frames were not refused", camera.seen().size()));
  print("refusal [ms]", camera.insert_ms());
}

void measure(const scene::Scene& scene, double seconds, Sees sees) {
  control::Controller::Options options;
  options.position = true;
  control::Controller controller(scene, {HAMELIN_TEST_PLUGIN_DIR}, options);
  scene::Scene full = scene;
  full.map->known = true;
  const model::Model arm = control::load_model(scene);
  std::vector<control::PointFrame> frames = frames_of(full, arm);
  std::atomic<double> now_s{0.0};
  std::vector<double> tick_ms;
  std::vector<std::pair<Clock::time_point, std::uint64_t>> ticks;  // when each snapshot was known
  Eigen::VectorXd q = scene.start_q, v = Eigen::VectorXd::Zero(q.size());
  // as much is in the map in all cases
  for (const control::PointFrame& frame : frames) (void)controller.world().insert_points(frame);
  (void)controller.tick(0.0, q, v);
  std::optional<Camera> camera;
  if (sees == Sees::refused_frames) frames = bad_frames(frames[0]);
  if (sees != Sees::nothing) camera.emplace(controller.world(), std::move(frames), now_s);
  auto next = Clock::now();
  for (long k = 1; static_cast<double>(k) * period_s < seconds; ++k) {
    next += std::chrono::microseconds(1000);
    std::this_thread::sleep_until(next);
    now_s = period_s * static_cast<double>(k);
    const auto since = Clock::now();
    const control::Answer& answer = controller.tick(now_s, q, v);
    tick_ms.push_back(ms_since(since));
    if (ticks.empty() || ticks.back().second != answer.snapshot)
      ticks.emplace_back(Clock::now(), answer.snapshot);
    q = answer.q_next;
    v = answer.v_next;
    if (answer.state == control::ControlState::reached) controller.set_goals(scene.goals);
  }
  print(fmt::format("tick with {} [ms]", name_of(sees)), tick_ms);
  if (!camera) return;
  camera->join();
  if (sees == Sees::refused_frames) return check_refused(*camera);
  std::vector<double> delay_ms;
  for (const Seen& seen : camera->seen()) {
    const auto known = std::find_if(ticks.begin(), ticks.end(),
                                    [&](const auto& tick) { return tick.second >= seen.snapshot; });
    if (known != ticks.end() && known->first > seen.there)
      delay_ms.push_back(
          std::chrono::duration<double, std::milli>(known->first - seen.there).count());
  }
  print("insert_points [ms]", camera->insert_ms());
  print("frame to tick [ms]", delay_ms);
}

void print_table(double seconds) {
  scene::Scene scene =
      scene::read_scene(std::string(HAMELIN_SOURCE_DIR) + "/data/scenes/shelf.json");
  scene.map->file = std::string(HAMELIN_SOURCE_DIR) + "/data/maps/shelf.bt";
  fmt::print("{:<32}{:>8}{:>10}{:>10}{:>10}\n", "", "count", "p50", "p99", "max");
  for (const Sees sees : {Sees::nothing, Sees::frames, Sees::refused_frames})
    measure(scene, seconds, sees);
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 30.0;
  if (!(seconds > 0.1)) {
    fmt::print(stderr, "usage: {} [SECONDS]\n", argv[0]);
    return 2;
  }
  try {
    print_table(seconds);
  } catch (const std::exception& e) {
    fmt::print(stderr, "seeing_table: {}\n", e.what());
    return 1;
  }
  return 0;
}
