// HDF5 files, byte by byte: the file format itself, and so the HDF5 library, as well as our readers.
#include "tests/fuzz/read_hdf5.hpp"

namespace grainclock::fuzz {

void fuzz(std::string_view bytes) { read_hdf5(place().file("file.h5", bytes)); }

}  // namespace grainclock::fuzz
