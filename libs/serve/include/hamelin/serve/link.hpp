#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "hamelin/serve/hamelin_frames.h"

namespace hamelin::serve {

/// A file descriptor that is closed with its owner.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int fd) noexcept : fd_(fd) {}
  Descriptor(Descriptor&& other) noexcept : fd_(other.fd_) { other.fd_ = -1; }
  Descriptor& operator=(Descriptor&& other) noexcept;
  ~Descriptor();
  [[nodiscard]] int get() const noexcept { return fd_; }
  [[nodiscard]] bool is_open() const noexcept { return fd_ >= 0; }

 private:
  int fd_ = -1;
};

/// Shared memory with a hamelin_link, whose size cannot be changed any more.
class LinkMemory {
 public:
  LinkMemory() = default;
  /// @throws Error io if the memory cannot be mapped, or invalid if it holds no link of this
  /// version
  explicit LinkMemory(Descriptor memory);
  LinkMemory(LinkMemory&& other) noexcept;
  LinkMemory& operator=(LinkMemory&& other) noexcept;
  ~LinkMemory();
  /// @throws Error io
  [[nodiscard]] static LinkMemory make(std::uint32_t joints, bool position, double period_s);

  [[nodiscard]] int descriptor() const noexcept { return memory_.get(); }
  [[nodiscard]] hamelin_link& operator*() const noexcept { return *link_; }
  [[nodiscard]] hamelin_link* operator->() const noexcept { return link_; }

 private:
  void map();
  Descriptor memory_;
  hamelin_link* link_ = nullptr;
};

/// What the other end sent.
enum class News { frame, text, nothing, closed };

/// One end of a connection. Sends and receives messages; none of them blocks beyond its time.
class Connection {
 public:
  Connection() = default;
  explicit Connection(Descriptor socket) noexcept : socket_(std::move(socket)) {}
  /// @throws Error io if there is no server, or it has another client
  [[nodiscard]] static Connection to(const std::filesystem::path& socket, LinkMemory& memory);

  [[nodiscard]] bool is_open() const noexcept { return socket_.is_open(); }
  void close() noexcept { socket_ = {}; }
  /// Waits for a message. @param timeout_s at most so long; below 0: for ever
  /// @param sequence of a frame that is new in the memory @param text of another message
  [[nodiscard]] News wait(double timeout_s, std::uint64_t& sequence, std::string& text) const;
  /// Says that a frame is new. @return whether the other end is there
  bool ring(std::uint64_t sequence) const noexcept;
  /// Sends a text, also on another thread. @return false if the other end has gone, or has not read
  /// what it was sent before for a second
  bool send(std::string_view text) const noexcept;
  /// Hands over the memory, as the first message.
  bool hand_over(const LinkMemory& memory) const noexcept;

 private:
  Descriptor socket_;
};

/// The place at which a server is found.
class Listener {
 public:
  /// Replaces a socket that no server listens to. @throws Error io if one does, or it cannot be
  /// made
  explicit Listener(std::filesystem::path socket);
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  ~Listener();
  /// Waits for a client at most so long. @return none if there was none
  [[nodiscard]] std::optional<Connection> accept(double timeout_s);

 private:
  std::filesystem::path path_;
  Descriptor socket_;
};

}  // namespace hamelin::serve
