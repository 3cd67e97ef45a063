#include "xml.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <vector>

#include "hamelin/core/text.hpp"

namespace hamelin::description::detail {

namespace {

using Eigen::Vector3d;
using tinyxml2::XMLElement;

// The parser recurses into the tree of elements, and compares each attribute of a tag with all
// attributes before it.
constexpr int nesting_max = 100, attributes_max = 100;
constexpr std::size_t size_max = std::size_t{4} << 20;

// Scans the tags as TinyXML 2 does and refuses text that would take it too long. Its time for a tag
// grows with the square of the number of attributes.
class TagScan {
 public:
  TagScan(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  void check() {
    while ((at_ = text_.find('<', at_)) != std::string_view::npos) {
      if (!skip("<?", "?>") && !skip("<!--", "-->") && !skip("<![CDATA[", "]]>") &&
          !skip("<!", ">"))
        check_tag();
    }
  }

 private:
  [[noreturn]] void refuse(const std::string& message) const {
    const auto line =
        1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at_), '\n');
    fail(ErrorCode::parse, file_, static_cast<int>(line), message);
  }

  bool skip(std::string_view open, std::string_view close) {
    if (text_.substr(at_, open.size()) != open) return false;
    const auto found = text_.find(close, at_ + open.size());
    at_ = found == std::string_view::npos ? text_.size() : found + close.size();
    return true;
  }

  void check_tag() {
    const bool closes = text_.substr(at_, 2) == "</";
    int attributes = 0;
    for (++at_; at_ < text_.size() && text_[at_] != '>'; ++at_) {
      const char c = text_[at_];
      if (c == '<') refuse("not XML: '<' inside a tag");
      if (c == '=' && ++attributes > attributes_max)
        refuse(fmt::format("a tag has more than {} attributes", attributes_max));
      // A '>' in a value does not end the tag.
      if (c == '"' || c == '\'') at_ = std::min(text_.find(c, at_ + 1), text_.size() - 1);
    }
    if (at_ == text_.size()) return;  // the parser reports that the tag is not closed
    const bool empty = text_[at_ - 1] == '/';
    if (closes && empty) refuse("not XML: a closing tag ends in '/>'");
    ++at_;
    if (closes) depth_ = std::max(0, depth_ - 1);
    if (!closes && !empty && ++depth_ > nesting_max)
      refuse(fmt::format("elements nest deeper than {}", nesting_max));
  }

  std::string_view text_;
  const std::string& file_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

void check_text(std::string_view text, const std::string& file, const char* format) {
  if (text.size() > size_max)
    fail(ErrorCode::parse, file, 0,
         fmt::format("the file has {} bytes, expected at most {}", text.size(), size_max));
  if (text.find_first_not_of(" \t\r\n") == std::string_view::npos)
    fail(ErrorCode::parse, file, 0, "the file is empty, expected a <robot>");
  if (text.find('\0') != std::string_view::npos)
    fail(ErrorCode::parse, file, 0, fmt::format("the file is not text, expected {} (XML)", format));
  if (const auto good = utf8_prefix(text); good != text.size())
    fail(ErrorCode::parse, file, 0,
         fmt::format("byte {} is not UTF-8, expected {} (XML) in UTF-8", good, format));
  TagScan(text, file).check();
}

std::string describe(tinyxml2::XMLError error) {
  switch (error) {
    case tinyxml2::XML_ERROR_PARSING_ELEMENT:
      return "not XML: a tag has no name or is not closed";
    case tinyxml2::XML_ERROR_PARSING_ATTRIBUTE:
      return "not XML: an attribute is malformed or given twice, expected name=\"value\"";
    case tinyxml2::XML_ERROR_PARSING_TEXT:
      return "not XML: text outside of the root element";
    case tinyxml2::XML_ERROR_PARSING_CDATA:
      return "not XML: a CDATA section is not closed";
    case tinyxml2::XML_ERROR_PARSING_COMMENT:
      return "not XML: a comment is not closed";
    case tinyxml2::XML_ERROR_PARSING_DECLARATION:
      return "not XML: <?...?> is not closed or is not at the beginning";
    case tinyxml2::XML_ERROR_PARSING_UNKNOWN:
      return "not XML: <!...> is not closed";
    case tinyxml2::XML_ERROR_EMPTY_DOCUMENT:
      return "not XML: no element";
    case tinyxml2::XML_ERROR_MISMATCHED_ELEMENT:
      return "not XML: an element is not closed, or is closed by a tag of another name";
    case tinyxml2::XML_ERROR_PARSING:
      return "not XML: an element is not closed";
    case tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED:
      return fmt::format("elements nest deeper than {}", nesting_max);
    default:
      return fmt::format("not XML: {}", tinyxml2::XMLDocument::ErrorIDToName(error));
  }
}

// Character references (&#xD800;) in values can produce characters that the text itself may not
// contain.
void check_values(const XMLElement& element, const std::string& file) {
  for (const auto* a = element.FirstAttribute(); a != nullptr; a = a->Next())
    if (const std::string_view value = a->Value(); utf8_prefix(value) != value.size())
      fail(ErrorCode::parse, file, element.GetLineNum(),
           fmt::format("<{}>: {} refers to a character that does not exist", element.Name(),
                       a->Name()));
  for (const auto* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
    check_values(*e, file);
}

bool parse_number(std::string_view word, double& value) {
  // from_chars does not accept a '+'.
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc{} && end == word.data() + word.size() && std::isfinite(value);
}

std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  constexpr std::string_view blank = " \t\r\n";
  std::size_t at = 0;
  while ((at = text.find_first_not_of(blank, at)) != std::string_view::npos) {
    const auto end = std::min(text.find_first_of(blank, at), text.size());
    words.push_back(text.substr(at, end - at));
    at = end;
  }
  return words;
}

[[noreturn]] void fail_at_value(const XMLElement& element, const char* attribute,
                                const Owner& owner, const char* expected) {
  fail(ErrorCode::parse, owner.file, element.GetLineNum(),
       fmt::format("{}: <{}>: {}=\"{}\", expected {}", owner.name, element.Name(), attribute,
                   text_of(element, attribute), expected));
}

// The product of three quaternions of half angles. It is normalised twice, because after one pass
// the remaining error of the norm still affects the last bit of some rotations.
Eigen::Quaterniond quaternion_of(const Vector3d& rpy) {
  const Vector3d half = rpy / 2.0;
  const double cr = std::cos(half.x()), sr = std::sin(half.x());
  const double cp = std::cos(half.y()), sp = std::sin(half.y());
  const double cy = std::cos(half.z()), sy = std::sin(half.z());
  const double x = sr * cp * cy - cr * sp * sy, y = cr * sp * cy + sr * cp * sy;
  const double z = cr * cp * sy - sr * sp * cy, w = cr * cp * cy + sr * sp * sy;
  Eigen::Quaterniond q(w, x, y, z);
  q.coeffs() /= std::sqrt(x * x + y * y + z * z + w * w);
  return q.normalized();
}

}  // namespace

void fail(ErrorCode code, const std::string& file, int line, const std::string& message) {
  throw Error(code, line > 0 ? fmt::format("{}: line {}: {}", file, line, message)
                             : fmt::format("{}: {}", file, message));
}

const XMLElement& parse_robot_xml(tinyxml2::XMLDocument& document, const std::string& text,
                                  const std::string& file, const char* format) {
  check_text(text, file, format);
  if (const auto error = document.Parse(text.data(), text.size()); error != tinyxml2::XML_SUCCESS)
    fail(ErrorCode::parse, file, document.ErrorLineNum(), describe(error));
  const XMLElement* root = document.RootElement();
  if (root == nullptr || std::string_view(root->Name()) != "robot")
    fail(ErrorCode::parse, file, root == nullptr ? 1 : root->GetLineNum(),
         fmt::format("expected <robot> as the root, found {}",
                     root == nullptr ? "no element" : fmt::format("<{}>", root->Name())));
  if (const XMLElement* second = root->NextSiblingElement(); second != nullptr)
    fail(ErrorCode::parse, file, second->GetLineNum(),
         fmt::format("not XML: <{}> after the end of <robot>, expected one root", second->Name()));
  check_values(*root, file);
  return *root;
}

std::string text_of(const XMLElement& element, const char* attribute) {
  const char* const value = element.Attribute(attribute);
  return value == nullptr ? "" : value;
}

const XMLElement* only_child(const XMLElement& parent, const char* tag, const Owner& owner) {
  const XMLElement* first = parent.FirstChildElement(tag);
  const XMLElement* second = first == nullptr ? nullptr : first->NextSiblingElement(tag);
  if (second != nullptr)
    fail(ErrorCode::parse, owner.file, second->GetLineNum(),
         fmt::format("{}: <{}> is given twice, expected once", owner.name, tag));
  return first;
}

const XMLElement& required_child(const XMLElement& parent, const char* tag, const Owner& owner) {
  const XMLElement* child = only_child(parent, tag, owner);
  if (child == nullptr)
    fail(ErrorCode::parse, owner.file, parent.GetLineNum(),
         fmt::format("{}: <{}> is missing", owner.name, tag));
  return *child;
}

double number(const XMLElement& element, const char* attribute, const Owner& owner) {
  const char* const text = element.Attribute(attribute);
  if (text == nullptr)
    fail(ErrorCode::parse, owner.file, element.GetLineNum(),
         fmt::format("{}: <{}> has no {}", owner.name, element.Name(), attribute));
  double value = 0.0;
  if (!parse_number(text, value)) fail_at_value(element, attribute, owner, "a finite number");
  return value;
}

double number_or(const XMLElement& element, const char* attribute, const Owner& owner,
                 double otherwise) {
  return element.Attribute(attribute) == nullptr ? otherwise : number(element, attribute, owner);
}

Vector3d triple_or(const XMLElement& element, const char* attribute, const Owner& owner,
                   const Vector3d& otherwise) {
  const char* const text = element.Attribute(attribute);
  if (text == nullptr) return otherwise;
  const auto words = words_of(text);
  Vector3d values = Vector3d::Zero();
  bool good = words.size() == 3;
  for (std::size_t i = 0; good && i < 3; ++i)
    good = parse_number(words[i], values[static_cast<Eigen::Index>(i)]);
  if (!good) fail_at_value(element, attribute, owner, "three finite numbers");
  return values;
}

geometry::SE3 origin_of(const XMLElement& parent, const Owner& owner) {
  const XMLElement* origin = only_child(parent, "origin", owner);
  if (origin == nullptr) return {};
  return {quaternion_of(triple_or(*origin, "rpy", owner, Vector3d::Zero())).toRotationMatrix(),
          triple_or(*origin, "xyz", owner, Vector3d::Zero())};
}

}  // namespace hamelin::description::detail
