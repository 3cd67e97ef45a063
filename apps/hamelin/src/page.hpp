#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "document.hpp"

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

/// The data of a page about documents of one kind, from report::pack().
/// @throws Error io, parse or invalid, for a file of another kind too
using PageOfDocuments = std::string (*)(const std::vector<std::filesystem::path>& files);

/// An object of this type with static storage duration makes `hamelin report` take documents of
/// that kind. The sources of the command that writes them define it.
struct RegisteredPage {
  RegisteredPage(Kind kind, const char* page_template, PageOfDocuments make);
};

/// What is registered for a kind.
struct DocumentPage {
  const char* page_template = nullptr;
  PageOfDocuments make = nullptr;  ///< null: nothing
};
[[nodiscard]] DocumentPage page_of(Kind kind);

}  // namespace hamelin::app
