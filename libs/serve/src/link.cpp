#include "hamelin/serve/link.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <utility>

#include "hamelin/core/error.hpp"

namespace hamelin::serve {

namespace {

constexpr std::size_t text_max = 1 << 20;
// So long an end may take to read what it was sent, or to answer a connection [s].
constexpr double send_timeout_s = 1.0, connect_timeout_s = 5.0;

[[noreturn]] void fail(const std::string& what) {
  throw Error(ErrorCode::io, fmt::format("{}: {}", what, std::strerror(errno)));
}

sockaddr_un address_of(const std::filesystem::path& socket) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = socket.string();
  if (name.empty() || name.size() >= sizeof address.sun_path)
    throw Error(ErrorCode::usage, fmt::format("{}: has {} bytes, expected the path of a socket, 1 "
                                              "to {} bytes",
                                              name, name.size(), sizeof address.sun_path - 1));
  name.copy(address.sun_path, name.size());
  return address;
}

Descriptor make_socket() {
  Descriptor made(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  if (!made.is_open()) fail("socket");
  return made;
}

enum class Event { none, ready, end };

// Waits until a socket can be read or written, or the other end is closed.
Event wait_for(int fd, short events, double timeout_s) {
  pollfd one{fd, events, 0};
  timespec limit{};
  if (timeout_s >= 0.0) {
    limit.tv_sec = static_cast<time_t>(timeout_s);
    limit.tv_nsec = static_cast<long>(1e9 * (timeout_s - std::floor(timeout_s)));
  }
  if (::ppoll(&one, 1, timeout_s < 0.0 ? nullptr : &limit, nullptr) <= 0) return Event::none;
  return (one.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0 ? Event::end : Event::ready;
}

// The first message of a server: the magic number, and the descriptor of the memory.
Descriptor receive_memory(int socket) {
  std::uint64_t magic = 0;
  iovec part{&magic, sizeof magic};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  const ssize_t got = ::recvmsg(socket, &message, MSG_CMSG_CLOEXEC);
  const cmsghdr* const header = got > 0 ? CMSG_FIRSTHDR(&message) : nullptr;
  int fd = -1;
  if (header != nullptr && header->cmsg_type == SCM_RIGHTS)
    std::memcpy(&fd, CMSG_DATA(header), sizeof fd);
  Descriptor memory(fd);
  if (got != sizeof magic || magic != HAMELIN_LINK_MAGIC) return {};
  return memory;
}

// Removes a socket that a server has left behind, but none that a program listens to: only such a
// one refuses connections.
void remove_stale_socket(const std::filesystem::path& path, const sockaddr* where, socklen_t size) {
  std::error_code unknown;
  if (!std::filesystem::is_socket(path, unknown)) return;
  const Descriptor other(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!other.is_open()) fail("socket");
  if (::connect(other.get(), where, size) != 0 && errno == ECONNREFUSED) {
    std::filesystem::remove(path, unknown);
    return;
  }
  throw Error(ErrorCode::io, fmt::format("{}: another server listens, expected a socket of its own",
                                         path.string()));
}

}  // namespace

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  std::swap(fd_, other.fd_);
  return *this;
}

Descriptor::~Descriptor() {
  if (fd_ >= 0) ::close(fd_);
}

LinkMemory::LinkMemory(Descriptor memory) : memory_(std::move(memory)) {
  struct stat status {};
  if (::fstat(memory_.get(), &status) != 0) fail("the shared memory");
  if (status.st_size < static_cast<off_t>(sizeof(hamelin_link)))
    throw Error(ErrorCode::invalid, fmt::format("the shared memory has {} bytes, expected {}",
                                                status.st_size, sizeof(hamelin_link)));
  map();
  if (link_->magic != HAMELIN_LINK_MAGIC || link_->version != HAMELIN_LINK_VERSION ||
      link_->size != sizeof(hamelin_link) || link_->joints > HAMELIN_LINK_JOINTS)
    throw Error(
        ErrorCode::invalid,
        fmt::format("the shared memory holds version {} of {} bytes, expected version {} of "
                    "{} bytes",
                    link_->version, link_->size, int{HAMELIN_LINK_VERSION}, sizeof(hamelin_link)));
}

LinkMemory LinkMemory::make(std::uint32_t joints, bool position, double period_s) {
  LinkMemory made;
  made.memory_ = Descriptor(::memfd_create("hamelin_link", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!made.memory_.is_open() || ::ftruncate(made.descriptor(), sizeof(hamelin_link)) != 0 ||
      ::fcntl(made.descriptor(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0)
    fail("shared memory");
  made.map();
  *made.link_ = {};
  made.link_->magic = HAMELIN_LINK_MAGIC;
  made.link_->version = HAMELIN_LINK_VERSION;
  made.link_->size = sizeof(hamelin_link);
  made.link_->joints = joints;
  made.link_->position = position ? 1 : 0;
  made.link_->period_s = period_s;
  return made;
}

void LinkMemory::map() {
  void* const at =
      ::mmap(nullptr, sizeof(hamelin_link), PROT_READ | PROT_WRITE, MAP_SHARED, memory_.get(), 0);
  if (at == MAP_FAILED) fail("shared memory");
  link_ = static_cast<hamelin_link*>(at);
}

LinkMemory::LinkMemory(LinkMemory&& other) noexcept
    : memory_(std::move(other.memory_)), link_(std::exchange(other.link_, nullptr)) {}

LinkMemory& LinkMemory::operator=(LinkMemory&& other) noexcept {
  std::swap(memory_, other.memory_);
  std::swap(link_, other.link_);
  return *this;
}

LinkMemory::~LinkMemory() {
  if (link_ != nullptr) ::munmap(link_, sizeof(hamelin_link));
}

Connection Connection::to(const std::filesystem::path& socket, LinkMemory& memory) {
  const sockaddr_un address = address_of(socket);
  Descriptor made = make_socket();
  if (::connect(made.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    throw Error(ErrorCode::io, fmt::format("{}: {}, expected the socket of `hamelin serve`",
                                           socket.string(), std::strerror(errno)));
  if (wait_for(made.get(), POLLIN, connect_timeout_s) == Event::none)
    throw Error(ErrorCode::io, fmt::format("{}: no message within {} s, expected the memory of "
                                           "`hamelin serve`",
                                           socket.string(), connect_timeout_s));
  Descriptor received = receive_memory(made.get());
  if (!received.is_open())
    throw Error(ErrorCode::io,
                fmt::format("{}: the server has closed the connection, expected one that has no "
                            "other client",
                            socket.string()));
  memory = LinkMemory(std::move(received));
  return Connection(std::move(made));
}

News Connection::wait(double timeout_s, std::uint64_t& sequence, std::string& text) const {
  if (!is_open()) return News::closed;
  const Event event = wait_for(socket_.get(), POLLIN | POLLRDHUP, timeout_s);
  if (event == Event::none) return News::nothing;
  const ssize_t size = ::recv(socket_.get(), nullptr, 0, MSG_PEEK | MSG_TRUNC | MSG_DONTWAIT);
  if (size == static_cast<ssize_t>(sizeof sequence) &&
      ::recv(socket_.get(), &sequence, sizeof sequence, MSG_DONTWAIT) == size)
    return News::frame;
  if (size < 0 && (errno == EAGAIN || errno == EINTR)) return News::nothing;
  // an empty message looks like the end, but for the state of the socket
  if (size < 0 || (size == 0 && event == Event::end)) return News::closed;
  text.resize(std::min(static_cast<std::size_t>(size), text_max));
  (void)::recv(socket_.get(), text.data(), text.size(), MSG_DONTWAIT);
  return News::text;
}

// The kernel passes a message on under a lock, so that the frame, which was written before its
// number was sent, is read whole by whoever has received the number.
bool Connection::ring(std::uint64_t sequence) const noexcept {
  const ssize_t sent =
      ::send(socket_.get(), &sequence, sizeof sequence, MSG_NOSIGNAL | MSG_DONTWAIT);
  // an end that has not read the numbers before is there, and reads the newest frame by those
  return sent == sizeof sequence || (sent < 0 && errno == EAGAIN);
}

bool Connection::send(std::string_view text) const noexcept {
  if (wait_for(socket_.get(), POLLOUT, send_timeout_s) != Event::ready) return false;
  return ::send(socket_.get(), text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT) ==
         static_cast<ssize_t>(text.size());
}

bool Connection::hand_over(const LinkMemory& memory) const noexcept {
  std::uint64_t magic = HAMELIN_LINK_MAGIC;
  iovec part{&magic, sizeof magic};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  cmsghdr* const header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = SCM_RIGHTS;
  header->cmsg_len = CMSG_LEN(sizeof(int));
  const int fd = memory.descriptor();
  std::memcpy(CMSG_DATA(header), &fd, sizeof fd);
  return ::sendmsg(socket_.get(), &message, MSG_NOSIGNAL) == sizeof magic;
}

Listener::Listener(std::filesystem::path socket) : path_(std::move(socket)) {
  const sockaddr_un address = address_of(path_);
  const auto* const where = reinterpret_cast<const sockaddr*>(&address);
  remove_stale_socket(path_, where, sizeof address);
  socket_ = make_socket();
  // nobody else may move the arm
  const mode_t mask = ::umask(0077);
  const int bound = ::bind(socket_.get(), where, sizeof address);
  ::umask(mask);
  if (bound != 0 || ::listen(socket_.get(), 4) != 0) fail(path_.string());
}

Listener::~Listener() {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

std::optional<Connection> Listener::accept(double timeout_s) {
  if (wait_for(socket_.get(), POLLIN, timeout_s) == Event::none) return std::nullopt;
  Descriptor client(::accept4(socket_.get(), nullptr, nullptr, SOCK_CLOEXEC));
  if (!client.is_open()) return std::nullopt;
  return Connection(std::move(client));
}

}  // namespace hamelin::serve
