#pragma once
#include <tinyxml2.h>

#include <Eigen/Core>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/se3.hpp"

/// XML for URDF and SRDF: checks of the text, the parser, and attributes as numbers. Only the
/// sources of this library include TinyXML 2.
namespace hamelin::description::detail {

/// The element whose content is read, for messages: for example "arm.urdf" and "link 'upper'".
struct Owner {
  std::string file;
  std::string name;
};

/// @param line number of the line; 0 leaves it out of the message
/// @throws Error always: "file: line N: message"
[[noreturn]] void fail(ErrorCode code, const std::string& file, int line,
                       const std::string& message);

/// Checks the text, then parses it.
/// @param file name of the file, for messages
/// @param format "URDF" or "SRDF", for messages
/// @return the root element <robot>, owned by the document
/// @throws Error parse if the text is empty, too large, not UTF-8, nested too deep or not XML, or
/// has another root element
[[nodiscard]] const tinyxml2::XMLElement& parse_robot_xml(tinyxml2::XMLDocument& document,
                                                          const std::string& text,
                                                          const std::string& file,
                                                          const char* format);

/// An attribute's text; empty if there is no such attribute.
[[nodiscard]] std::string text_of(const tinyxml2::XMLElement& element, const char* attribute);

/// The only child of that name, or null.
/// @throws Error parse if there are several
[[nodiscard]] const tinyxml2::XMLElement* only_child(const tinyxml2::XMLElement& parent,
                                                     const char* tag, const Owner& owner);
/// @throws Error parse if there are several or none
[[nodiscard]] const tinyxml2::XMLElement& required_child(const tinyxml2::XMLElement& parent,
                                                         const char* tag, const Owner& owner);

/// An attribute as a finite number.
/// @throws Error parse if it is absent or not a finite number
[[nodiscard]] double number(const tinyxml2::XMLElement& element, const char* attribute,
                            const Owner& owner);
[[nodiscard]] double number_or(const tinyxml2::XMLElement& element, const char* attribute,
                               const Owner& owner, double otherwise);
/// Three finite numbers separated by blanks; `otherwise` if the attribute is absent.
[[nodiscard]] Eigen::Vector3d triple_or(const tinyxml2::XMLElement& element, const char* attribute,
                                        const Owner& owner, const Eigen::Vector3d& otherwise);

/// <origin xyz rpy> of a parent; the identity if there is none. The rotation is Rz(yaw) Ry(pitch)
/// Rx(roll).
[[nodiscard]] geometry::SE3 origin_of(const tinyxml2::XMLElement& parent, const Owner& owner);

}  // namespace hamelin::description::detail
