#include "mgdd/common/platform.hpp"

namespace mgdd {

std::string compiled_simd_level() {
#if defined(__AVX512F__)
  return "avx512f";
#elif defined(__AVX2__)
  return "avx2";
#elif defined(__SSE2__)
  return "sse2";
#elif defined(__ARM_NEON)
  return "neon";
#else
  return "scalar";
#endif
}

std::vector<std::string> processor_simd_levels() {
  std::vector<std::string> levels;
#if defined(__x86_64__) && (defined(__GNUC__) || defined(__clang__))
  if (__builtin_cpu_supports("sse2")) levels.emplace_back("sse2");
  if (__builtin_cpu_supports("avx2")) levels.emplace_back("avx2");
  if (__builtin_cpu_supports("avx512f")) levels.emplace_back("avx512f");
#else
  levels.push_back(compiled_simd_level());
#endif
  return levels;
}

}  // namespace mgdd
