#include "mgdd/rig/socketcan_transport.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <system_error>
#include <type_traits>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/rig/monotonic_clock.hpp"

#if defined(__linux__) && __has_include(<linux/can/raw.h>)
#define MGDD_SOCKETCAN 1
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <ctime>
#endif

namespace mgdd::rig {

void validate(const SocketCanSettings& s) {
  if (s.interface.empty() || s.interface.size() > 15) {
    throw ParameterError("interface", s.interface, "must be the name of an interface, 1 to 15 characters");
  }
  if (s.receive_buffer_bytes < 1) throw ParameterError("receive_buffer_bytes", s.receive_buffer_bytes, "must be >= 1");
  require_within("send_patience_s", s.send_patience_s, 0.0, 0.1, "s");
  for (const CanFilter& filter : s.filters) {
    const std::uint32_t largest = filter.extended ? 0x1FFF'FFFFu : 0x7FFu;
    if (filter.id > largest) throw ParameterError("id", filter.id, "must have 11 bits, or 29 if extended");
  }
}

#ifdef MGDD_SOCKETCAN

namespace {

static_assert(bus_error::bus_off == CAN_ERR_BUSOFF && bus_error::controller == CAN_ERR_CRTL &&
              bus_error::restarted == CAN_ERR_RESTARTED && bus_error::receive_passive == CAN_ERR_CRTL_RX_PASSIVE &&
              bus_error::transmit_passive == CAN_ERR_CRTL_TX_PASSIVE && bus_error::active_again == CAN_ERR_CRTL_ACTIVE);

constexpr std::int64_t between_tries_ns = 50'000;

std::string why(int error) {
  return std::generic_category().message(error);
}

void require(bool done, const std::string& what) {
  if (!done) throw RigError(what + ": " + why(errno));
}

template <class T>
bool set_option(int descriptor, int level, int name, const T& value) noexcept {
  return setsockopt(descriptor, level, name, &value, sizeof value) == 0;
}

std::int64_t in_ns(const timespec& t) noexcept {
  return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

std::string known_interfaces() {
  std::string names;
  if (auto* const all = if_nameindex()) {
    for (const auto* one = all; one->if_index != 0; ++one)
      names.append(names.empty() ? "" : ", ").append(one->if_name);
    if_freenameindex(all);
  }
  return names;
}

void set_filters(int descriptor, const std::vector<CanFilter>& wanted) {
  if (wanted.empty()) return;
  std::vector<can_filter> filters;
  for (const CanFilter& f : wanted) {
    const std::uint32_t kind = f.extended ? CAN_EFF_FLAG : 0u;
    filters.push_back({f.id | kind, f.mask | CAN_EFF_FLAG | CAN_RTR_FLAG});
  }
  const auto size = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  require(setsockopt(descriptor, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), size) == 0, "CAN filters");
}

void bind_to(int descriptor, const SocketCanSettings& s) {
  ifreq request{};
  std::copy(s.interface.begin(), s.interface.end(), request.ifr_name);
  if (ioctl(descriptor, SIOCGIFINDEX, &request) != 0) {
    throw RigError("no interface '" + s.interface + "': there are " + known_interfaces());
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  require(ioctl(descriptor, SIOCGIFFLAGS, &request) == 0, "state of " + s.interface);
  if ((request.ifr_flags & IFF_UP) == 0) {
    throw RigError("the interface " + s.interface + " is down: ip link set " + s.interface + " up");
  }
  if (s.fd) {
    require(ioctl(descriptor, SIOCGIFMTU, &request) == 0, "frame size of " + s.interface);
    if (request.ifr_mtu < static_cast<int>(CANFD_MTU)) {
      throw RigError("the interface " + s.interface + " cannot do CAN FD: set fd to false, or its MTU to 72");
    }
    require(set_option(descriptor, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1), "CAN FD frames");
  }
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): so is the interface of sockets
  if (bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw RigError("the interface " + s.interface + " is not a CAN interface: " + why(errno));
  }
}

int opened(const SocketCanSettings& s) {
  const int descriptor = socket(AF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (descriptor < 0) {
    throw RigError("this kernel has no CAN sockets (" + why(errno) +
                   "): load the modules can and can_raw, or use a RingTransport over python-can");
  }
  try {
    set_filters(descriptor, s.filters);
    require(set_option(descriptor, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, can_err_mask_t{CAN_ERR_MASK}), "error frames");
    bind_to(descriptor, s);
  } catch (...) {
    close(descriptor);
    throw;
  }
  return descriptor;
}

}  // namespace

SocketCanTransport::SocketCanTransport(const SocketCanSettings& settings)
    : SocketCanTransport((validate(settings), opened(settings)), settings) {}

SocketCanTransport::SocketCanTransport(int descriptor, const SocketCanSettings& settings)
    : settings_(settings), descriptor_(descriptor), empty_ns_(monotonic_ns()) {
  try {
    validate(settings);
    prepare();
  } catch (...) {
    close(descriptor_);
    throw;
  }
}

SocketCanTransport::~SocketCanTransport() {
  close(descriptor_);
}

void SocketCanTransport::prepare() {
  const int bytes = settings_.receive_buffer_bytes;
  if (!set_option(descriptor_, SOL_SOCKET, SO_RCVBUFFORCE, bytes)) {  // beyond rmem_max, where allowed
    require(set_option(descriptor_, SOL_SOCKET, SO_RCVBUF, bytes), "receive buffer");
  }
  socklen_t size = sizeof receive_buffer_bytes_;
  require(getsockopt(descriptor_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes_, &size) == 0, "receive buffer");
  require(set_option(descriptor_, SOL_SOCKET, SO_RXQ_OVFL, 1), "count of dropped frames");
  require(set_option(descriptor_, SOL_SOCKET, SO_TIMESTAMPNS, 1), "stamps of frames");
}

bool SocketCanTransport::receive(Frame& frame) noexcept {
  canfd_frame raw{};
  iovec part{&raw, sizeof raw};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t bytes = recvmsg(descriptor_, &message, MSG_DONTWAIT);
  const std::int64_t now_ns = monotonic_ns();
  if (bytes < 0) {
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) {
      empty_ns_ = now_ns;
    } else {
      note_failure(errno);
    }
    return false;
  }
  if (bytes != CAN_MTU && bytes != CANFD_MTU) return false;
  down_.store(false, std::memory_order_relaxed);
  counts_.received.add();

  frame = {};
  frame.received = true;
  frame.error = (raw.can_id & CAN_ERR_FLAG) != 0;
  frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = !frame.error && (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.id = raw.can_id & (frame.error ? CAN_ERR_MASK : frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.fd = bytes == CANFD_MTU;
  frame.bit_rate_switch = frame.fd && (raw.flags & CANFD_BRS) != 0;
  frame.size = std::min<std::uint8_t>(raw.len, frame.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN);
  std::copy_n(&raw.data[0], frame.size, frame.data.begin());
  frame.monotonic_ns = now_ns;
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
    if (c->cmsg_level != SOL_SOCKET) continue;
    if (c->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp{}, wall{};
      std::memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
      clock_gettime(CLOCK_REALTIME, &wall);
      frame.bus_ns = in_ns(stamp);
      frame.monotonic_ns = std::clamp(now_ns - (in_ns(wall) - frame.bus_ns), empty_ns_, now_ns);
    } else if (c->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t dropped = 0;  // since the socket was opened, 32 bits that wrap
      std::memcpy(&dropped, CMSG_DATA(c), sizeof dropped);
      counts_.lost.add(static_cast<std::uint32_t>(dropped - dropped_by_kernel_));
      dropped_by_kernel_ = dropped;
    }
  }
  monitor_.push(frame);
  return true;
}

SendResult SocketCanTransport::send(const Frame& frame) noexcept {
  const std::size_t largest = frame.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN;
  if (frame.error || frame.size > largest || (frame.fd && (!settings_.fd || frame.remote))) {
    counts_.failed.add();
    return SendResult::failed;
  }
  canfd_frame raw{};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0u) | (frame.remote ? CAN_RTR_FLAG : 0u);
  raw.len = frame.size;
  if (frame.fd && frame.bit_rate_switch) raw.flags = CANFD_BRS;
  std::copy_n(frame.data.begin(), frame.size, &raw.data[0]);
  const std::size_t bytes = frame.fd ? CANFD_MTU : CAN_MTU;
  const std::int64_t until_ns = monotonic_ns() + static_cast<std::int64_t>(settings_.send_patience_s * 1e9);
  for (;;) {
    if (::send(descriptor_, &raw, bytes, MSG_DONTWAIT | MSG_NOSIGNAL) == static_cast<ssize_t>(bytes)) {
      counts_.sent.add();
      return SendResult::sent;
    }
    const int error = errno;
    if (error == EINTR) continue;
    if (error != ENOBUFS && error != EAGAIN && error != EWOULDBLOCK) {
      note_failure(error);
      counts_.failed.add();
      return SendResult::failed;
    }
    const std::int64_t now_ns = monotonic_ns();
    if (now_ns >= until_ns) {
      counts_.full.add();
      return SendResult::full;
    }
    counts_.retries.add();
    sleep_until_ns(std::min(now_ns + between_tries_ns, until_ns));
  }
}

#else

SocketCanTransport::SocketCanTransport(const SocketCanSettings& settings) : SocketCanTransport(-1, settings) {}
SocketCanTransport::SocketCanTransport(int, const SocketCanSettings& settings)
    : settings_((validate(settings), settings)) {
  throw RigError("SocketCAN is part of Linux only: use a RingTransport over python-can");
}
SocketCanTransport::~SocketCanTransport() = default;
bool SocketCanTransport::receive(Frame&) noexcept {
  return false;
}
SendResult SocketCanTransport::send(const Frame&) noexcept {
  return SendResult::failed;
}

#endif

BusState SocketCanTransport::bus_state() const noexcept {
  return down_.load(std::memory_order_relaxed) ? BusState::off : monitor_.state();
}

void SocketCanTransport::note_failure(int error) noexcept {
  if (error == ENETDOWN || error == ENODEV || error == ENXIO || error == EBADF) {
    down_.store(true, std::memory_order_relaxed);
  }
}

}  // namespace mgdd::rig
