#include "topics.hpp"

#include "foxglove_schemas.hpp"

namespace hamelin::mcap {

namespace {

struct Definition {
  const char* name;
  Json (*schema)();
};

Definition definition_of(Topic topic) {
  switch (topic) {
    case Topic::transforms:
      return {"/tf", frame_transforms_schema};
    case Topic::static_transforms:
      return {"/tf_static", frame_transforms_schema};
    case Topic::joints:
      return {"/joint_states", joint_states_schema};
    case Topic::state:
      return {"/state", state_schema};
    case Topic::arm:
      return {"/arm", scene_update_schema};
    case Topic::map:
      return {"/map", scene_update_schema};
    case Topic::obstacles:
      return {"/obstacles", scene_update_schema};
    case Topic::goals:
      return {"/goals", scene_update_schema};
    case Topic::drawing:
      return {"/drawing", scene_update_schema};
    case Topic::log:
      break;
  }
  return {"/log", log_schema};
}

}  // namespace

void Topics::send(Topic topic, std::uint64_t time_ns, const Json& message) {
  // Names that are not UTF-8 (such as paths) get replacement characters.
  writer_.write(channel_of(topic), time_ns,
                message.dump(-1, ' ', false, Json::error_handler_t::replace));
}

std::uint16_t Topics::channel_of(Topic topic) {
  if (const auto known = channels_.find(topic); known != channels_.end()) return known->second;
  const Definition definition = definition_of(topic);
  const Json schema = definition.schema();
  const auto name = schema["title"].get<std::string>();
  auto& id = schemas_[name];
  if (id == 0) id = writer_.add_schema(name, "jsonschema", schema.dump());
  return channels_[topic] = writer_.add_channel(id, definition.name, "json");
}

}  // namespace hamelin::mcap
