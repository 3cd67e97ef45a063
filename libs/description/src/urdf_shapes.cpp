#include <fmt/format.h>

#include <string_view>

#include "hamelin/io/file.hpp"
#include "urdf_file.hpp"

namespace hamelin::description {

namespace detail {

namespace {

using Eigen::Vector3d;
using tinyxml2::XMLElement;

// The only element inside <geometry>.
const XMLElement& shape_element(const XMLElement& element, const Owner& owner) {
  const XMLElement& geometry = required_child(element, "geometry", owner);
  const XMLElement* shape = geometry.FirstChildElement();
  if (shape == nullptr)
    fail(ErrorCode::parse, owner.file, geometry.GetLineNum(),
         fmt::format("{}: <geometry> is empty, expected a box, cylinder, sphere or mesh",
                     owner.name));
  if (const XMLElement* second = shape->NextSiblingElement(); second != nullptr)
    fail(ErrorCode::parse, owner.file, second->GetLineNum(),
         fmt::format("{}: <geometry> has both <{}> and <{}>, expected one shape", owner.name,
                     shape->Name(), second->Name()));
  return *shape;
}

void require(const XMLElement& element, const char* attribute, const Owner& owner) {
  if (element.Attribute(attribute) == nullptr)
    fail(ErrorCode::parse, owner.file, element.GetLineNum(),
         fmt::format("{}: <{}> has no {}", owner.name, element.Name(), attribute));
}

LinkShape read_shape(const XMLElement& element, const Owner& owner) {
  const XMLElement& shape = shape_element(element, owner);
  const std::string_view kind = shape.Name();
  LinkShape out;
  out.line = shape.GetLineNum();
  out.pose = origin_of(element, owner);
  if (kind == "sphere") {
    out.kind = LinkShape::Kind::sphere;
    out.radius_m = number(shape, "radius", owner);
  } else if (kind == "box") {
    out.kind = LinkShape::Kind::box;
    require(shape, "size", owner);
    out.size_m = triple_or(shape, "size", owner, Vector3d::Zero());
  } else if (kind == "cylinder") {
    out.kind = LinkShape::Kind::cylinder;
    out.radius_m = number(shape, "radius", owner);
    out.length_m = number(shape, "length", owner);
  } else if (kind == "mesh") {
    out.kind = LinkShape::Kind::mesh;
    require(shape, "filename", owner);
    out.mesh = text_of(shape, "filename");
    out.scale = triple_or(shape, "scale", owner, Vector3d::Ones());
  } else {
    fail(ErrorCode::parse, owner.file, out.line,
         fmt::format("{}: <{}> is not a shape of URDF, expected a box, cylinder, sphere or mesh",
                     owner.name, kind));
  }
  return out;
}

}  // namespace

const char* tag_of(LinkShape::Kind kind) {
  switch (kind) {
    case LinkShape::Kind::sphere:
      return "sphere";
    case LinkShape::Kind::box:
      return "box";
    case LinkShape::Kind::cylinder:
      return "cylinder";
    case LinkShape::Kind::mesh:
      break;
  }
  return "mesh";
}

std::vector<LinkShape> read_shapes(const XMLElement& link, const char* tag, const Owner& owner) {
  std::vector<LinkShape> shapes;
  for (const XMLElement* e = link.FirstChildElement(tag); e != nullptr;
       e = e->NextSiblingElement(tag))
    shapes.push_back(read_shape(*e, owner));
  return shapes;
}

void check_sizes(const LinkShape& shape, const Owner& owner) {
  const auto refuse = [&](const std::string& message) {
    fail(ErrorCode::invalid, owner.file, shape.line,
         fmt::format("{}: <{}>: {}", owner.name, tag_of(shape.kind), message));
  };
  const auto positive = [&](const char* dimension, double value) {
    if (!(value > 0.0))
      refuse(fmt::format("{} {} m, expected a positive number", dimension, value));
  };
  switch (shape.kind) {
    case LinkShape::Kind::sphere:
      positive("radius", shape.radius_m);
      break;
    case LinkShape::Kind::box:
      for (const double size : shape.size_m) positive("size", size);
      break;
    case LinkShape::Kind::cylinder:
      positive("radius", shape.radius_m);
      positive("length", shape.length_m);
      break;
    case LinkShape::Kind::mesh:
      if (shape.mesh.empty()) refuse("the filename is empty, expected a mesh file");
      if (!((shape.scale.array() != 0.0).all()))
        refuse("the scale has a factor 0, expected factors other than 0");
      break;
  }
}

}  // namespace detail

std::vector<LinkGeometry> read_urdf_geometry(const std::filesystem::path& file) {
  const std::string text = read_file(file), where = file.string();
  if (file.extension() != ".urdf")
    throw Error(ErrorCode::usage, fmt::format("{}: unknown kind of file '{}', expected .urdf",
                                              where, file.extension().string()));
  std::vector<LinkGeometry> links;
  for (detail::UrdfLink& link : detail::read_urdf_file(text, where, detail::Visuals::read).links) {
    const detail::Owner owner{where, fmt::format("link '{}'", link.name())};
    for (const auto* shapes : {&link.shapes.collision, &link.shapes.visual})
      for (const LinkShape& shape : *shapes) check_sizes(shape, owner);
    links.push_back(std::move(link.shapes));
  }
  return links;
}

}  // namespace hamelin::description
