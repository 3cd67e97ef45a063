#pragma once
#include "hamelin/core/isa.hpp"

/// Defines `const Set& select_NAME(Isa)`, which returns the object NAME compiled for that
/// instruction set. A source under hamelin_isa_sources defines one such object per set. Use the
/// macro in the namespace that encloses theirs. The function throws an Error for a set that this
/// machine does not have.
#if defined(__x86_64__)
#define HAMELIN_SELECT_KERNELS(Set, name)                                                      \
  inline namespace isa_baseline {                                                              \
  extern const Set name;                                                                       \
  }                                                                                            \
  namespace isa_v3 {                                                                           \
  extern const Set name;                                                                       \
  }                                                                                            \
  namespace isa_v4 {                                                                           \
  extern const Set name;                                                                       \
  }                                                                                            \
  static const Set& select_##name(Isa isa) {                                                   \
    require_available(isa);                                                                    \
    return isa == Isa::v4 ? isa_v4::name : isa == Isa::v3 ? isa_v3::name : isa_baseline::name; \
  }
#else
#define HAMELIN_SELECT_KERNELS(Set, name)    \
  inline namespace isa_baseline {            \
  extern const Set name;                     \
  }                                          \
  static const Set& select_##name(Isa isa) { \
    require_available(isa);                  \
    return isa_baseline::name;               \
  }
#endif
