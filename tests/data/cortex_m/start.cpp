// Reset of a Cortex-M in QEMU: the floating-point unit on, then the C library, whose files and output are the host's.
#include <cstdint>

extern "C" {
extern char __stack;
void _start();
[[noreturn]] void reset() {
  *reinterpret_cast<volatile std::uint32_t*>(0xE000ED88) |= 0xFU << 20;  // CPACR: full access to CP10 and CP11
  __asm volatile("dsb\n isb");
  _start();
  for (;;) {
  }
}
}
[[gnu::section(".vectors"), gnu::used]] void* const vectors[] = {&__stack, reinterpret_cast<void*>(reset)};
