#pragma once
#include <filesystem>
#include <string>

/// Pages that open offline, made from the templates that the build bundles where it finds Node.js.
namespace hamelin::app {

/// The template of that name beside this program: "page" (of `hamelin report`), "sweep" or "accuracy".
/// @throws Error io, one line that says what was missing when hamelin was built
[[nodiscard]] std::filesystem::path page_template(const std::string& name);

/// Fills a template, replaces the target by the page, and gives its size.
/// @param data as report::make_data() or report::pack() made it
std::size_t write_page(const std::filesystem::path& page_template, const std::string& data,
                       const std::filesystem::path& target);

}  // namespace hamelin::app
