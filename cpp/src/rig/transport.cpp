#include "mgdd/rig/transport.hpp"

namespace mgdd::rig {}  // namespace mgdd::rig
