// The fuzz targets without clang, as fast tests: replay N DIRECTORY gives a target every file there, and then N mutants of them,
// always the same.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

struct Input {
  std::string path, bytes;
};

std::vector<Input> inputs_in(const char* directory) {
  std::vector<Input> inputs;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    std::ifstream in(entry.path(), std::ios::binary);
    inputs.push_back({entry.path().string(), {std::istreambuf_iterator<char>(in), {}}});
  }
  // Directories have no order, and mutants are to be the same everywhere.
  std::sort(inputs.begin(), inputs.end(), [](const Input& a, const Input& b) { return a.path < b.path; });
  return inputs;
}

class Mutations {
 public:
  /// One to four changes: a bit turned, a byte replaced, a stretch left out, doubled, or taken from `other`.
  std::string of(std::string bytes, const std::string& other) {
    for (std::size_t left = 1 + below(4); left > 0 && !bytes.empty(); --left) {
      const std::size_t at = below(bytes.size()), length = 1 + below(std::min<std::size_t>(bytes.size() - at, 64));
      switch (below(5)) {
        case 0: bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8))); break;
        case 1: bytes[at] = static_cast<char>(below(256)); break;
        case 2: bytes.erase(at, length); break;
        case 3: bytes.insert(at, bytes.substr(at, length)); break;
        default: bytes.insert(at, other, below(other.size() + 1), length);
      }
    }
    return bytes;
  }
  std::size_t below(std::size_t end) { return random_() % end; }

 private:
  std::mt19937 random_;  // its numbers are the same in every library; distributions are not
};

void replay(const std::string& name, const std::string& bytes) {
  std::fprintf(stderr, "%s\n", name.c_str());  // the last line tells which one failed
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const int mutants = std::stoi(argv[1]);
  const std::vector<Input> inputs = inputs_in(argv[2]);
  if (inputs.empty()) return 1;
  for (const Input& input : inputs) replay(input.path, input.bytes);
  Mutations mutations;
  for (int k = 0; k < mutants; ++k) {
    const Input &input = inputs[mutations.below(inputs.size())], &other = inputs[mutations.below(inputs.size())];
    replay(input.path + ", mutant " + std::to_string(k), mutations.of(input.bytes, other.bytes));
  }
  std::printf("%zu inputs, %d mutants of them\n", inputs.size(), mutants);
  return 0;
}
