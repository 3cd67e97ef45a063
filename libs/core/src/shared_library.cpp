#include "hamelin/core/shared_library.hpp"

#include <dlfcn.h>

#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin {

SharedLibrary::SharedLibrary(const char* file, const char* purpose)
    : file_(file), handle_(::dlopen(file, RTLD_NOW | RTLD_LOCAL)) {
  if (handle_ == nullptr)
    throw Error(ErrorCode::io,
                formatted("{}: cannot be loaded, but {} needs it: {}", file, purpose, ::dlerror()));
}

void* SharedLibrary::symbol(const char* name) const {
  void* const found = ::dlsym(handle_, name);
  if (found == nullptr)
    throw Error(ErrorCode::io,
                formatted("{}: has no symbol '{}', expected another version", file_, name));
  return found;
}

}  // namespace hamelin
