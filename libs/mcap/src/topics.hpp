#pragma once
#include <cstdint>
#include <map>
#include <string>

#include "hamelin/io/json.hpp"
#include "hamelin/mcap/writer.hpp"

namespace hamelin::mcap {

/// The topics of a file. Messages of a topic have one schema.
enum class Topic : std::int32_t {
  transforms,         ///< foxglove.FrameTransforms: links, tip, obstacles that move, target
  static_transforms,  ///< foxglove.FrameTransforms: base and map
  joints,             ///< foxglove.JointStates
  state,              ///< hamelin.State
  arm,                ///< foxglove.SceneUpdate, as all below but the last
  map,
  obstacles,
  goals,
  drawing,  ///< lines that the planner has drawn
  log       ///< foxglove.Log: events and the result
};

/// Sends JSON messages. Schemas and channels are written before the first message that uses them.
class Topics {
 public:
  explicit Topics(Writer& writer) : writer_(writer) {}
  void send(Topic topic, std::uint64_t time_ns, const Json& message);

 private:
  [[nodiscard]] std::uint16_t channel_of(Topic topic);

  Writer& writer_;
  std::map<Topic, std::uint16_t> channels_;
  std::map<std::string, std::uint16_t> schemas_;  ///< by name
};

}  // namespace hamelin::mcap
