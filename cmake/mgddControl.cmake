# mgdd::control, the controllers of a throttle plate: without Eigen, and compiled by the project that asks, so for its
# target and with its flags.
if(NOT TARGET mgdd::control)
  file(GLOB mgdd_control_sources "${mgdd_source_dir}/control/*.cpp")
  add_library(mgdd_control STATIC EXCLUDE_FROM_ALL ${mgdd_control_sources})
  add_library(mgdd::control ALIAS mgdd_control)
  target_compile_features(mgdd_control PUBLIC cxx_std_20)
  target_include_directories(mgdd_control PUBLIC "${mgdd_include_dir}")
  # No fused multiply-add by the compiler's choice: every target rounds alike, in what stands in headers too.
  target_compile_options(
    mgdd_control PUBLIC $<$<CXX_COMPILER_ID:GNU,Clang,AppleClang,ARMClang>:-ffp-contract=off>
  )
endif()
