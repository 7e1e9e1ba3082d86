#include "vision/file.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace binpick::vision {
namespace {
constexpr std::size_t kFileBytesMax = std::size_t{1} << 31;

struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
};

std::string unreadable(const std::string& path, const std::string& why) {
  return "cannot read " + path + ": " + why + "; check the path and its permissions";
}

/// Opened for reading, or why not.
std::string open_file(const std::string& path, Descriptor& file, struct stat& status) {
  file.fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file.fd < 0 || ::fstat(file.fd, &status) != 0) return unreadable(path, std::strerror(errno));
  return S_ISDIR(status.st_mode) ? unreadable(path, "it is a folder") : std::string{};
}
}  // namespace

Expected<std::vector<std::byte>, std::string> read_file(const std::string& path) {
  const auto failed = [&](const std::string& why) { return unexpected(unreadable(path, why)); };
  Descriptor file{-1};
  struct stat status {};
  if (auto why = open_file(path, file, status); !why.empty()) return unexpected(std::move(why));
  std::vector<std::byte> bytes;
  if (status.st_size > 0 && static_cast<std::size_t>(status.st_size) <= kFileBytesMax)
    bytes.reserve(static_cast<std::size_t>(status.st_size) + 1);
  // Until the end, not until st_size: pipes have none.
  for (;;) {
    const std::size_t held = bytes.size();
    const std::size_t room = bytes.capacity() > held ? bytes.capacity() - held : 65536;
    bytes.resize(held + room);
    const ssize_t got = ::read(file.fd, bytes.data() + held, room);
    bytes.resize(held + (got > 0 ? static_cast<std::size_t>(got) : 0));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return failed(std::strerror(errno));
    if (got == 0) return bytes;
    if (bytes.size() > kFileBytesMax) return failed("it is larger than 2 GiB");
  }
}

FileBytes kept(std::vector<std::byte> bytes) {
  const auto keeper = std::make_shared<const std::vector<std::byte>>(std::move(bytes));
  return {*keeper, keeper};
}

Expected<FileBytes, std::string> map_file(const std::string& path) {
  Descriptor file{-1};
  struct stat status {};
  if (auto why = open_file(path, file, status); !why.empty()) return unexpected(std::move(why));
  const auto size = static_cast<std::size_t>(status.st_size);
  void* const at =
      S_ISREG(status.st_mode) && size > 0 ? ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.fd, 0) : MAP_FAILED;
  if (at == MAP_FAILED) {
    auto bytes = read_file(path);
    if (!bytes) return unexpected(bytes.error());
    return kept(std::move(*bytes));
  }
  const std::shared_ptr<const void> keeper(at, [size](const void* p) { ::munmap(const_cast<void*>(p), size); });
  return FileBytes{{static_cast<const std::byte*>(at), size}, keeper};
}

Expected<void, std::string> write_file(const std::string& path, std::span<const std::byte> bytes) {
  const std::string beside = path + ".part" + std::to_string(::getpid());
  const auto failed = [&] {
    const std::string why = std::strerror(errno);
    ::unlink(beside.c_str());
    return unexpected("cannot write " + path + ": " + why + "; check the folder, its permissions and its free space");
  };
  {
    const Descriptor file{::open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644)};
    if (file.fd < 0) return failed();
    while (!bytes.empty()) {
      const ssize_t put = ::write(file.fd, bytes.data(), bytes.size());
      if (put < 0 && errno == EINTR) continue;
      if (put < 0) return failed();
      bytes = bytes.subspan(static_cast<std::size_t>(put));
    }
    if (::fsync(file.fd) != 0) return failed();
  }
  if (std::rename(beside.c_str(), path.c_str()) != 0) return failed();
  // The new name lasts through a power cut only when the folder has been written too. Some network file systems know no
  // such call on a folder: theirs is the server's matter.
  const auto slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const Descriptor names{::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (names.fd >= 0 && ::fsync(names.fd) != 0 && errno == EIO) return failed();
  return {};
}
}  // namespace binpick::vision
