// The shared memory, the socket, and the header that clients in other languages go by.
#include "hamelin/serve/link.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>

#include "hamelin/test/errors.hpp"
#include "serving.hpp"

using namespace hamelin;
using Catch::Contains;
using serve::Connection;
using serve::Descriptor;
using serve::LinkMemory;
using serve::Listener;
using serve::News;
using test::error_of;

namespace {

/// A listening socket of a program that is no server of hamelin.
Descriptor listen_at(const std::filesystem::path& path, int type) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.string().copy(address.sun_path, sizeof address.sun_path - 1);
  Descriptor made(::socket(AF_UNIX, type, 0));
  REQUIRE(::bind(made.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) == 0);
  REQUIRE(::listen(made.get(), 4) == 0);
  return made;
}

struct Pair {
  Pair() {
    int ends[2];
    REQUIRE(::socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends) == 0);
    here = Connection(Descriptor(ends[0]));
    there = Descriptor(ends[1]);
  }
  News wait(double timeout_s = 0.0) { return here.wait(timeout_s, sequence, text); }
  Connection here;
  Descriptor there;
  std::uint64_t sequence = 0;
  std::string text;
};

}  // namespace

TEST_CASE("frames have the layout that clients in other languages assume", "[serve]") {
  CHECK(sizeof(hamelin_measurement) == 536);
  CHECK(offsetof(hamelin_measurement, request) == 528);
  CHECK(sizeof(hamelin_setpoint) == 1032);
  CHECK(offsetof(hamelin_setpoint, clearance_m) == 784);
  CHECK(offsetof(hamelin_setpoint, cause) == 832);
  CHECK(sizeof(hamelin_link) == 1600);
  CHECK(offsetof(hamelin_link, measurement) == 32);
  CHECK(offsetof(hamelin_link, setpoint) == 568);
  CHECK(hamelin_checksum("123456789", 9) == 0xcbf43926U);  // the check value of CRC-32
  CHECK(hamelin_checksum("", 0) == 0);
}

TEST_CASE("shared memory is mapped elsewhere, and cannot change its size", "[serve]") {
  const LinkMemory memory = LinkMemory::make(7, true, 0.002);
  const LinkMemory other(Descriptor(::dup(memory.descriptor())));
  CHECK(other->joints == 7);
  CHECK(other->position == 1);
  CHECK(other->period_s == 0.002);
  other->measurement.q[3] = 0.5;
  CHECK(memory->measurement.q[3] == 0.5);
  CHECK(::ftruncate(memory.descriptor(), 0) == -1);
  CHECK(errno == EPERM);
  CHECK(::ftruncate(memory.descriptor(), 1 << 20) == -1);
}

TEST_CASE("memory of another program, version or size is refused", "[serve]") {
  const LinkMemory memory = LinkMemory::make(7, false, 0.001);
  const auto open = [&] { const LinkMemory again(Descriptor(::dup(memory.descriptor()))); };
  CHECK(error_of(open) == "no error");
  SECTION("magic") {
    memory->magic ^= 1;
  }
  SECTION("version") {
    ++memory->version;
  }
  SECTION("size") {
    --memory->size;
  }
  SECTION("joints") {
    memory->joints = 33;
  }
  CHECK_THAT(error_of(open), Contains("expected"));
}

TEST_CASE("memory that is too small, or none, is refused", "[serve]") {
  Descriptor small(::memfd_create("small", 0));
  REQUIRE(::ftruncate(small.get(), 100) == 0);
  CHECK_THAT(error_of([&] { const LinkMemory memory(std::move(small)); }), Contains("100 bytes"));
  CHECK_THAT(error_of([] { const LinkMemory memory{Descriptor()}; }), Contains("descriptor"));
}

TEST_CASE("messages are told apart: a number, a text, nothing, the end", "[serve]") {
  Pair pair;
  CHECK(pair.wait() == News::nothing);
  const std::uint64_t number = 42;
  REQUIRE(::send(pair.there.get(), &number, sizeof number, 0) == sizeof number);
  REQUIRE(::send(pair.there.get(), "{\"stop\":1}", 10, 0) == 10);
  CHECK(pair.wait() == News::frame);
  CHECK(pair.sequence == 42);
  CHECK(pair.wait() == News::text);
  CHECK(pair.text == "{\"stop\":1}");
  const std::string large(100'000, 'x');
  REQUIRE(::send(pair.there.get(), large.data(), large.size(), 0) > 0);
  CHECK(pair.wait() == News::text);
  CHECK(pair.text == large);
  pair.there = {};
  CHECK(pair.wait() == News::closed);
  CHECK_FALSE(pair.here.ring(1));  // and no SIGPIPE
  CHECK_FALSE(pair.here.send("text"));
}

TEST_CASE("an empty message is a text, and does not end the connection", "[serve]") {
  Pair pair;
  REQUIRE(::send(pair.there.get(), "", 0, 0) == 0);
  CHECK(pair.wait() == News::text);
  CHECK(pair.text.empty());
  CHECK(pair.wait() == News::nothing);
  REQUIRE(::send(pair.there.get(), "", 0, 0) == 0);
  pair.there = {};
  while (pair.wait() == News::text) {
  }
  CHECK(pair.wait() == News::closed);
}

TEST_CASE("sending does not block for ever if the other end does not read", "[serve]") {
  Pair pair;
  for (int i = 0; i < 3000; ++i) CHECK(pair.here.ring(1));  // the other end is there
  const double since_s = control::steady_clock_s();
  CHECK_FALSE(pair.here.send("text"));
  CHECK(control::steady_clock_s() - since_s < 30.0);
}

TEST_CASE("a second server at the same socket is refused", "[serve]") {
  const test::TemporaryFolder folder;
  const Listener first(folder.path() / "arm");
  struct stat status {};
  REQUIRE(::stat((folder.path() / "arm").c_str(), &status) == 0);
  CHECK((status.st_mode & 0777) == 0700);  // nobody else may connect
  CHECK_THAT(error_of([&] { const Listener second(folder.path() / "arm"); }),
             Contains("another server"));
  CHECK(std::filesystem::is_socket(folder.path() / "arm"));
}

TEST_CASE("a socket that a server has left behind is replaced, and removed at the end", "[serve]") {
  const test::TemporaryFolder folder;
  { const Descriptor left = listen_at(folder.path() / "arm", SOCK_SEQPACKET); }
  {
    Listener again(folder.path() / "arm");
    CHECK_FALSE(again.accept(0.0));
  }
  CHECK_FALSE(std::filesystem::exists(folder.path() / "arm"));
}

TEST_CASE("sockets of other programs and files are not replaced", "[serve]") {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "other";
  const auto listen = [&] { const Listener server(path); };
  {
    const Descriptor other = listen_at(path, SOCK_STREAM);
    CHECK_THAT(error_of(listen), Contains("other"));
    CHECK(std::filesystem::is_socket(path));
  }
  std::filesystem::remove(path);
  folder.put("other", "text");
  CHECK_THAT(error_of(listen), Contains("other"));
  CHECK(std::filesystem::file_size(path) == 4);
}

TEST_CASE("a path that a socket cannot have is refused by its length", "[serve]") {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / std::string(120, 'x');
  CHECK_THAT(error_of([&] { const Listener server(path); }), Contains("expected the path"));
  LinkMemory memory;
  CHECK_THAT(error_of([&] { (void)Connection::to(path, memory); }), Contains("expected the path"));
  CHECK_THAT(error_of([&] { (void)Connection::to("", memory); }), Contains("expected the path"));
}

TEST_CASE("a client without a server is told so", "[serve]") {
  const test::TemporaryFolder folder;
  LinkMemory memory;
  const auto connect = [&] { (void)Connection::to(folder.path() / "arm", memory); };
  CHECK_THAT(error_of(connect), Contains("hamelin serve"));
  // a program that accepts and says something else
  const Descriptor other = listen_at(folder.path() / "arm", SOCK_SEQPACKET);
  std::thread answering([&] {
    const Descriptor client(::accept(other.get(), nullptr, nullptr));
    (void)::send(client.get(), "12345678", 8, MSG_NOSIGNAL);
  });
  CHECK_THAT(error_of(connect), Contains("expected"));
  answering.join();
}
