#pragma once
#include <filesystem>
#include <string>

/// HTML pages that open offline. Their templates are built if Node.js was found.
namespace hamelin::app {

/// The installed template of that name: "page" (of `hamelin report`), "sweep" or "accuracy".
/// @throws Error io with what was missing when hamelin was built
[[nodiscard]] std::filesystem::path page_template(const std::string& name);

/// Fills a template with data and replaces the target by the page.
/// @param data from report::make_data() or report::pack()
/// @return the size of the page in bytes
std::size_t write_page(const std::filesystem::path& page_template, const std::string& data,
                       const std::filesystem::path& target);

}  // namespace hamelin::app
