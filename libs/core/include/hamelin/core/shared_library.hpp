#pragma once
#include <string>

namespace hamelin {

/// A third-party library that is loaded when it is needed, so that programs that never need it
/// start without it. It stays loaded until the process ends.
class SharedLibrary {
 public:
  /// @param file  name of the file, which the dynamic linker searches for: "libassimp.so.5"
  /// @param purpose  what needs it, for the message
  /// @throws Error io if it cannot be loaded
  SharedLibrary(const char* file, const char* purpose);

  /// A function of the library: `library.find<decltype(mj_step)>("mj_step")`.
  /// @throws Error io if the library has no such symbol
  template <typename Function>
  [[nodiscard]] Function* find(const char* name) const {
    return reinterpret_cast<Function*>(symbol(name));
  }

 private:
  [[nodiscard]] void* symbol(const char* name) const;

  std::string file_;
  void* handle_;
};

/// Declares a member that points to a function of C of the same name, for tables such as
/// `struct Api { SharedLibrary library{…}; HAMELIN_LOADED(library, mj_step); };`
// NOLINTBEGIN(bugprone-macro-parentheses): a declaration
#define HAMELIN_LOADED(library, name) \
  decltype(::name)* name = (library).find<decltype(::name)>(#name)
// NOLINTEND(bugprone-macro-parentheses)

}  // namespace hamelin
