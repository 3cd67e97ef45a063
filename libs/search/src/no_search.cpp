#include "hamelin/core/error.hpp"
#include "search.hpp"

namespace hamelin::search {

bool available() noexcept {
  return false;
}

Found search(const Search&) {
  throw Error(ErrorCode::invalid, std::string(why_unavailable()));
}

}  // namespace hamelin::search
