#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hamelin/control/motion_estimator.hpp"
#include "hamelin/control/point_frame.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::control {

class PostureHistory;
class SensedMap;
class SensedMovers;
template <class T>
class Newest;

/// The surroundings of an arm at some moment. Immutable once published; queries may run on any
/// thread.
struct WorldSnapshot {
  /// Grows with each update since the world was made; no two snapshots have the same.
  std::uint64_t number = 0;
  scene::Environment environment;
  /// One per obstacle of the environment: a number that the obstacle keeps for its life and that no
  /// other obstacle of this world gets.
  std::vector<std::int32_t> obstacle_ids;
  /// The number of the last update that changed the map or an obstacle that stood still.
  std::uint64_t standing = 0;
  /// What of the world may be touched and is left out here, see World::allow(); 0: nothing.
  std::uint64_t allowance = 0;
  /// The same world for each allowance.
  std::vector<std::shared_ptr<const WorldSnapshot>> allowed;
};

/// The surroundings of an arm, which any thread may update while another one uses them. Each update
/// makes a new snapshot from the last one and publishes it; the control loop picks up the newest at
/// its next tick, without waiting. An update that is invalid throws and changes nothing. Updates
/// cost what building the snapshot costs: microseconds for obstacles, milliseconds for a map.
class World {
 public:
  struct Options {
    double influence_m = 0.2;        ///< the largest distance at which obstacles are found
    std::size_t obstacles_max = 64;  ///< the largest number of obstacles at a time
    /// Compute with each update what queries inside the map would compute first, so that no tick
    /// ever allocates or waits. Updates by insert_points() are the exception: a tick in which the
    /// arm is inside what was seen computes the surface near it.
    bool prepare = true;
    ObservationOptions observations{};  ///< of the poses that observe_obstacle() is given
    /// How far beyond the tip payloads extend [m], and how many shapes they have.
    double payload_reach_m = 0.0;
    std::size_t payload_shapes = 0;
  };

  /// The surroundings of a scene: its map with unknown space and self-filter, and its obstacles,
  /// except those that are judge_only or not known. The id of an obstacle of the scene is its index
  /// there, also if it is added later.
  /// @throws Error io, parse or invalid, also for more obstacles than obstacles_max;
  ///        invalid for options that check() refuses
  World(const scene::Scene& scene, const model::Model& model, const Options& options);
  ~World();

  /// Adds an obstacle, or replaces the one of the same name, which keeps its id.
  /// @return the number of the snapshot from which on it exists, as do all updates
  /// @throws Error invalid for an obstacle that check() refuses or that is hidden from planners, a
  ///         pose that is not finite, or more obstacles than obstacles_max
  std::uint64_t set_obstacle(scene::Obstacle obstacle);
  /// Moves an obstacle: at time_s it is at the pose, from where it goes on with the velocity
  /// [m/s].
  /// @throws Error invalid if there is no such obstacle, or for numbers that are not finite
  std::uint64_t move_obstacle(std::string_view name, const geometry::SE3& pose,
                              const Eigen::Vector3d& velocity_m_s, double time_s);
  /// Takes a pose of a stream: at its time the obstacle is at the pose, from where it goes on with
  /// the velocities and the acceleration that are given or, if they are not, estimated from the
  /// poses of the stream, docs/theory.md (11.46)–(11.49). A stream begins, at rest, with the first
  /// pose after set_obstacle(), move_obstacle() or a gap longer than the time-out. An obstacle's
  /// speed_max_m_s bounds the estimated velocities of its points, and with
  /// scene::Prediction::speed_bound no acceleration is used.
  /// @throws Error invalid if there is no such obstacle, for numbers that are not finite, a time
  ///         that is not later than last_observed(), a pose that the obstacle cannot have reached
  ///         since the last one of its stream at its speed_max_m_s, docs/theory.md (11.50), and an
  ///         obstacle whose path is known
  std::uint64_t observe_obstacle(std::string_view name, const Observation& observation);
  /// The time for which observe_obstacle() or move_obstacle() last told where the obstacle is; none
  /// if they have not since it was set. A stream that ends does not stop the obstacle: compare this
  /// with the time of the tick.
  /// @throws Error invalid if there is no such obstacle
  [[nodiscard]] std::optional<double> last_observed(std::string_view name) const;
  /// @throws Error invalid if there is no such obstacle
  std::uint64_t remove_obstacle(std::string_view name);
  /// Replaces the map; none: removes it. Obstacles stay. Changes that the map lists with a time are
  /// not made: change_map() makes them when they are due.
  /// @param q configuration in which a self-filter finds the arm; of size zero: the scene's start
  /// @throws Error io, parse or invalid
  std::uint64_t set_map(const std::optional<scene::MapSpec>& map, const Eigen::VectorXd& q = {});
  /// Frees and occupies voxels of the map, see scene::MapChangeSpec.
  /// @throws Error io, parse or invalid, also if there is no map
  std::uint64_t change_map(const scene::MapChangeSpec& change);

  /// Makes snapshots tell, from the next one on, how the world is where something may be touched,
  /// which costs as much as an update for each allowance. Those of the call before are kept for
  /// goals that are still in force.
  /// @return a number for each of them; 0 for one that is empty
  /// @throws Error invalid for what check() refuses
  std::vector<std::uint64_t> allow(const std::vector<scene::Allowance>& allowances);
  /// @throws Error invalid, "may_touch: …", for an obstacle that does not exist
  void require_obstacles(const scene::Allowance& allowance) const;

  /// Takes what a depth sensor saw into the map: points that were on the arm, its load or an
  /// obstacle of the world are left out, rays to the others free the voxels that they pass, and the
  /// points occupy theirs, docs/theory.md (20.1). What all frames since set_map() or change_map()
  /// told is kept; before them, the map is as sure as scene::PointsSpec lets it be. Bodies that
  /// move become obstacles, "mover SOURCE.ID", which later frames move. Takes some 0.1 s for 320 ×
  /// 240 points; other updates than those of the map need not wait.
  /// @throws Error invalid, "points: …", for a frame that check() refuses, if there is no map, for
  ///         a time that is after that of the last tick by more than 10 ms or before it by more
  ///         than scene::PointsSpec::age_max_s, and for a sensor that is in an occupied voxel;
  ///         nothing changes then
  FrameReport insert_points(const PointFrame& frame);

  /// Where the arm is, and with which load, see note_load(). For the thread of the control loop:
  /// never waits, never allocates.
  void note_posture(double time_s, const Eigen::VectorXd& q, std::uint64_t load) noexcept;
  /// The model of the arm with a load; that of load 0 is the one that the world was made with.
  void note_load(std::uint64_t load, model::Model model);

  /// The newest snapshot, for queries on any thread but that of the control loop: this locks, but
  /// never for longer than it takes to copy a pointer.
  /// @param allowance returned by allow(): what it allows is left out. Those that the world has
  ///        forgotten leave nothing out
  [[nodiscard]] std::shared_ptr<const WorldSnapshot> latest(std::uint64_t allowance = 0) const;

  /// A snapshot with the working memory of queries on it.
  struct View {
    std::shared_ptr<const WorldSnapshot> snapshot;
    scene::Environment::Scratch scratch;
    std::vector<View> allowed;  ///< one per snapshot->allowed

    /// The view of what is left where an allowance holds; this one if it is 0 or not known.
    [[nodiscard]] View& with(std::uint64_t allowance) noexcept;
  };
  /// The newest snapshot, valid until the next call. For the thread of the control loop: never
  /// waits, never allocates.
  [[nodiscard]] View& take() noexcept;
  /// The newest snapshot with working memory of its own. Any thread; this allocates.
  [[nodiscard]] View view_of_latest() const;

  [[nodiscard]] double influence_m() const noexcept { return options_.influence_m; }
  /// The largest number of shapes of an arm, payloads included.
  [[nodiscard]] std::size_t shapes_max() const noexcept;
  /// How far beyond the tip the surroundings are known [m].
  [[nodiscard]] double payload_reach_m() const noexcept { return options_.payload_reach_m; }
  [[nodiscard]] std::size_t obstacles_max() const noexcept { return options_.obstacles_max; }
  /// The largest number of contacts that a query can find.
  [[nodiscard]] std::size_t contacts_max() const noexcept { return contacts_max_; }

 private:
  /// What an update changes.
  enum class Changes { standing, moving };
  std::uint64_t publish(scene::Environment environment, std::vector<std::int32_t> ids,
                        Changes changes);
  [[nodiscard]] View view_of(std::shared_ptr<const WorldSnapshot> snapshot) const;
  /// What goals may touch, and the map without it.
  struct Allowed {
    std::uint64_t number;
    std::uint64_t list;  ///< of the last call of allow() that asked for it
    scene::Allowance allowance;
    scene::Environment map;
  };
  [[nodiscard]] bool allows() const;
  /// The entry for an allowance, which is added if there is none.
  [[nodiscard]] Allowed& allowed(std::vector<Allowed>& among, const scene::Allowance& allowance);
  /// All of them in an environment with another map.
  [[nodiscard]] std::vector<Allowed> allowed_in(const scene::Environment& environment) const;
  [[nodiscard]] std::shared_ptr<const WorldSnapshot> snapshot_with(const Allowed& allowed,
                                                                   const WorldSnapshot& all,
                                                                   Changes changes);
  /// Publishes an environment with another map. The caller has locked map_mutex_.
  std::uint64_t publish_map(const scene::Environment& environment);
  [[nodiscard]] bool prepares_maps() const;
  /// Arms at the time of a frame, one for each posture that may be the one.
  struct SeenArm;
  [[nodiscard]] SeenArm arm_seen_by(const PointFrame& frame, const scene::PointsSpec& spec) const;
  /// What a frame tells of what is not known otherwise.
  struct SeenPoints;
  [[nodiscard]] SeenPoints seen_points(const PointFrame& frame,
                                       const scene::Environment& environment) const;
  /// The stream of an obstacle after an observation that continues or begins it.
  [[nodiscard]] MotionEstimator followed(const scene::Obstacle& obstacle, std::int32_t id,
                                         const Observation& observation) const;
  [[nodiscard]] scene::Environment make_environment(const std::optional<scene::MapSpec>& map,
                                                    const Eigen::VectorXd& q) const;

  Options options_;
  scene::Scene scene_;  ///< name, base and start
  const model::Model& model_;
  std::size_t contacts_max_ = 0;
  // The control loop takes none of these.
  std::mutex map_mutex_;             ///< among writers of the map; taken before `mutex_`
  mutable std::mutex mutex_;         ///< among writers
  mutable std::mutex latest_mutex_;  ///< of `latest_`, which only writers change
  std::int32_t next_id_ = 0;
  std::map<std::int32_t, MotionEstimator> streams_;  ///< of observed poses, by the obstacle's id
  /// Obstacles of the scene that are not known at first, with their indices in the scene.
  std::vector<std::pair<std::string, std::int32_t>> reserved_;
  std::uint64_t last_number_ = 0;  ///< of a snapshot
  /// Changed by who has locked both `map_mutex_` and `mutex_`.
  std::vector<Allowed> allowed_;
  std::uint64_t allowed_lists_ = 0, last_allowance_ = 0;
  std::shared_ptr<const WorldSnapshot> latest_;
  std::unique_ptr<Newest<View>> newest_;
  std::unique_ptr<SensedMap> sensed_;  ///< none: nothing was seen since the map was set or changed
  std::unique_ptr<SensedMovers> movers_;
  std::unique_ptr<PostureHistory> postures_;
  mutable std::mutex loads_mutex_;
  std::map<std::uint64_t, std::shared_ptr<const model::Model>> loads_;  ///< the last few
};

}  // namespace hamelin::control
