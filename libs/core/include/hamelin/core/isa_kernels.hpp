#pragma once
#include "hamelin/core/isa.hpp"

// What an instruction set contributes to a selection: the declaration of its object, and the branch
// that returns it. A build without the set (HAMELIN_INSTRUCTION_SETS) has neither.
// NOLINTBEGIN(bugprone-macro-parentheses): names and declarations
#define HAMELIN_DECLARE_KERNELS(space, Set, name) \
  space {                                         \
    extern const Set name;                        \
  }
#ifdef HAMELIN_WITHOUT_BASELINE
#define HAMELIN_DECLARE_BASELINE(Set, name)
#define HAMELIN_RETURN_BASELINE(isa, name)
#else
#define HAMELIN_DECLARE_BASELINE(Set, name) \
  HAMELIN_DECLARE_KERNELS(inline namespace isa_baseline, Set, name)
#define HAMELIN_RETURN_BASELINE(isa, name) \
  if (isa == Isa::baseline) return isa_baseline::name;
#endif
#if !defined(__x86_64__) || defined(HAMELIN_WITHOUT_V3)
#define HAMELIN_DECLARE_V3(Set, name)
#define HAMELIN_RETURN_V3(isa, name)
#else
#define HAMELIN_DECLARE_V3(Set, name) HAMELIN_DECLARE_KERNELS(namespace isa_v3, Set, name)
#define HAMELIN_RETURN_V3(isa, name) \
  if (isa == Isa::v3) return isa_v3::name;
#endif
#if !defined(__x86_64__) || defined(HAMELIN_WITHOUT_V4)
#define HAMELIN_DECLARE_V4(Set, name)
#define HAMELIN_RETURN_V4(isa, name)
#else
#define HAMELIN_DECLARE_V4(Set, name) HAMELIN_DECLARE_KERNELS(namespace isa_v4, Set, name)
#define HAMELIN_RETURN_V4(isa, name) \
  if (isa == Isa::v4) return isa_v4::name;
#endif
// NOLINTEND(bugprone-macro-parentheses)

/// Defines `const Set& select_NAME(Isa)`, which returns the object NAME compiled for that
/// instruction set. A source under hamelin_isa_sources defines one such object per set. Use the
/// macro in the namespace that encloses theirs. The function throws an Error for a set that this
/// machine or this build does not have.
#define HAMELIN_SELECT_KERNELS(Set, name)    \
  HAMELIN_DECLARE_BASELINE(Set, name)        \
  HAMELIN_DECLARE_V3(Set, name)              \
  HAMELIN_DECLARE_V4(Set, name)              \
  static const Set& select_##name(Isa isa) { \
    require_available(isa);                  \
    HAMELIN_RETURN_BASELINE(isa, name)       \
    HAMELIN_RETURN_V3(isa, name)             \
    HAMELIN_RETURN_V4(isa, name)             \
    __builtin_unreachable();                 \
  }
