#include "foxglove_schemas.hpp"

#include <initializer_list>
#include <string>
#include <utility>

namespace hamelin::mcap {

namespace {

using Properties = std::initializer_list<std::pair<const char*, Json>>;

// An object of which only some properties are required.
Json partial_object(const std::string& title, const Properties& properties, Json required) {
  Json schema{{"title", title}, {"type", "object"}, {"properties", Json::object()}};
  for (const auto& [name, property] : properties) schema["properties"][name] = property;
  schema["required"] = std::move(required);
  return schema;
}

Json object(const std::string& title, const Properties& properties) {
  Json required = Json::array();
  for (const auto& property : properties) required.push_back(property.first);
  return partial_object(title, properties, std::move(required));
}

Json array(Json items) {
  return {{"type", "array"}, {"items", std::move(items)}};
}

Json text() {
  return {{"type", "string"}};
}

Json number() {
  return {{"type", "number"}};
}

Json boolean() {
  return {{"type", "boolean"}};
}

Json natural() {
  return {{"type", "integer"}, {"minimum", 0}};
}

// Numbers of an enumeration, counted from 0.
Json enumeration(const std::string& title, std::initializer_list<const char*> names) {
  Json values = Json::array();
  for (const char* name : names) values.push_back({{"title", name}, {"const", values.size()}});
  return {{"title", title}, {"oneOf", std::move(values)}};
}

Json seconds(const char* title, Json whole) {
  return {{"type", "object"},
          {"title", title},
          {"properties",
           {{"sec", std::move(whole)},
            {"nsec", {{"type", "integer"}, {"minimum", 0}, {"maximum", 999999999}}}}}};
}

Json time() {
  return seconds("time", natural());
}

Json vector(const char* title) {
  return object(title, {{"x", number()}, {"y", number()}, {"z", number()}});
}

Json vector3() {
  return vector("foxglove.Vector3");
}

Json quaternion() {
  return object("foxglove.Quaternion",
                {{"x", number()}, {"y", number()}, {"z", number()}, {"w", number()}});
}

Json pose() {
  return object("foxglove.Pose", {{"position", vector3()}, {"orientation", quaternion()}});
}

Json color() {
  return object("foxglove.Color",
                {{"r", number()}, {"g", number()}, {"b", number()}, {"a", number()}});
}

// A cube or a sphere.
Json sized_primitive(const char* title) {
  return object(title, {{"pose", pose()}, {"size", vector3()}, {"color", color()}});
}

Json arrow() {
  return object("foxglove.ArrowPrimitive", {{"pose", pose()},
                                            {"shaft_length", number()},
                                            {"shaft_diameter", number()},
                                            {"head_length", number()},
                                            {"head_diameter", number()},
                                            {"color", color()}});
}

Json cylinder() {
  return object("foxglove.CylinderPrimitive", {{"pose", pose()},
                                               {"size", vector3()},
                                               {"bottom_scale", number()},
                                               {"top_scale", number()},
                                               {"color", color()}});
}

Json line() {
  return object(
      "foxglove.LinePrimitive",
      {{"type", enumeration("foxglove.LineType", {"LINE_STRIP", "LINE_LOOP", "LINE_LIST"})},
       {"pose", pose()},
       {"thickness", number()},
       {"scale_invariant", boolean()},
       {"points", array(vector("foxglove.Point3"))},
       {"color", color()},
       {"colors", array(color())},
       {"indices", array(natural())}});
}

Json triangles() {
  return object("foxglove.TriangleListPrimitive", {{"pose", pose()},
                                                   {"points", array(vector("foxglove.Point3"))},
                                                   {"color", color()},
                                                   {"colors", array(color())},
                                                   {"indices", array(natural())}});
}

Json label() {
  return object("foxglove.TextPrimitive", {{"pose", pose()},
                                           {"billboard", boolean()},
                                           {"font_size", number()},
                                           {"scale_invariant", boolean()},
                                           {"color", color()},
                                           {"text", text()}});
}

Json mesh() {
  return object("foxglove.ModelPrimitive",
                {{"pose", pose()},
                 {"scale", vector3()},
                 {"color", color()},
                 {"override_color", boolean()},
                 {"url", text()},
                 {"media_type", text()},
                 {"data", {{"type", "string"}, {"contentEncoding", "base64"}}}});
}

Json scene_entity() {
  return object(
      "foxglove.SceneEntity",
      {{"timestamp", time()},
       {"frame_id", text()},
       {"id", text()},
       {"lifetime", seconds("duration", {{"type", "integer"}})},
       {"frame_locked", boolean()},
       {"metadata", array(object("foxglove.KeyValuePair", {{"key", text()}, {"value", text()}}))},
       {"arrows", array(arrow())},
       {"cubes", array(sized_primitive("foxglove.CubePrimitive"))},
       {"spheres", array(sized_primitive("foxglove.SpherePrimitive"))},
       {"cylinders", array(cylinder())},
       {"lines", array(line())},
       {"triangles", array(triangles())},
       {"texts", array(label())},
       {"models", array(mesh())}});
}

}  // namespace

Json frame_transforms_schema() {
  const Json transform = object("foxglove.FrameTransform", {{"timestamp", time()},
                                                            {"parent_frame_id", text()},
                                                            {"child_frame_id", text()},
                                                            {"translation", vector3()},
                                                            {"rotation", quaternion()}});
  return object("foxglove.FrameTransforms", {{"transforms", array(transform)}});
}

Json joint_states_schema() {
  const Json joint = partial_object("foxglove.JointState",
                                    {{"name", text()},
                                     {"position", number()},
                                     {"velocity", number()},
                                     {"acceleration", number()},
                                     {"effort", number()}},
                                    Json::array({"name"}));
  return object("foxglove.JointStates", {{"timestamp", time()}, {"joints", array(joint)}});
}

Json scene_update_schema() {
  const Json deletion =
      object("foxglove.SceneEntityDeletion",
             {{"timestamp", time()},
              {"type", enumeration("foxglove.SceneEntityDeletionType", {"MATCHING_ID", "ALL"})},
              {"id", text()}});
  return object("foxglove.SceneUpdate",
                {{"deletions", array(deletion)}, {"entities", array(scene_entity())}});
}

Json log_schema() {
  return object("foxglove.Log",
                {{"timestamp", time()},
                 {"level", enumeration("foxglove.LogLevel",
                                       {"UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"})},
                 {"message", text()},
                 {"name", text()},
                 {"file", text()},
                 {"line", natural()}});
}

Json state_schema() {
  const Json value = object("hamelin.NamedValue", {{"name", text()}, {"value", number()}});
  const Json energy = partial_object(
      "hamelin.Energy",
      {{"kinetic_J", number()}, {"potential_J", number()}, {"control_J", number()}}, Json::array());
  return partial_object("hamelin.State",
                        {{"timestamp", time()},
                         {"goal_index", natural()},
                         {"certified", boolean()},
                         {"stop", text()},
                         {"clearance_m", number()},
                         {"self_clearance_m", number()},
                         {"target_error_m", number()},
                         {"energy", energy},
                         {"series", array(value)}},
                        Json::array({"timestamp"}));
}

}  // namespace hamelin::mcap
