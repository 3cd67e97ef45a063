#include "page.hpp"

#include <fmt/format.h>

#include <map>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/report/report.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace fs = std::filesystem;

namespace {

std::map<Kind, DocumentPage>& pages() {
  static std::map<Kind, DocumentPage> all;
  return all;
}

}  // namespace

RegisteredPage::RegisteredPage(Kind kind, const char* page_template, PageOfDocuments make) {
  pages()[kind] = {page_template, make};
}

DocumentPage page_of(Kind kind) {
  const auto found = pages().find(kind);
  return found == pages().end() ? DocumentPage{} : found->second;
}

fs::path page_template(const std::string& name) {
  std::error_code ec;
  auto file = prefix().value_or("/") / "share" / "hamelin" / "report" / (name + ".html");
  if (!fs::is_regular_file(file, ec))
    throw Error(ErrorCode::io, fmt::format("{}: is missing: the page was not built, because "
                                           "Node.js, npm or access to its registry was missing "
                                           "when hamelin was built (or HAMELIN_BUILD_REPORT was "
                                           "OFF); install them (Debian: apt install nodejs npm) "
                                           "and build hamelin again",
                                           file.string()));
  return file;
}

std::size_t write_page(const fs::path& page_template, const std::string& data,
                       const fs::path& target) {
  const Phase phase("packing the page");
  const std::string page =
      report::make_page(read_file(page_template), data, page_template.string());
  write_file_atomically(target, page);
  return page.size();
}

}  // namespace hamelin::app
