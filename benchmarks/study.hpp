// Runs a study: every job in a process of its own and never twice, tables from the jobs' files, charts from the tables.
//
// DIR/study.toml marks the directory as a study's and keeps its text; DIR/jobs/ID.h5 is there once job ID is done
// (DIR/jobs/ID.log: what it complained about); DIR/NAME.csv and DIR/study.h5 are the tables.
#pragma once

#include "benchmarks/study_kind.hpp"

#include <string>

namespace grainclock::benchmarks {

struct StudyCall {
  std::string study;                       // file
  std::string out;                         // directory: new, empty, or one that holds a study
  int threads = 1;                         // of each job
  int processes = 1;                       // jobs at once; more than one spoil the wall clock
  bool charts = true;                      // drawn after the tables
  std::string program = "/proc/self/exe";  // that runs a job when called with `study STUDY --out DIR --job ID`
};

/// The ids of all jobs, one per line. Runs and writes nothing. Throws InputError, FileError.
std::string job_list(const StudyCall& call);

/// Runs what is not done yet, then writes tables and charts.
/// Throws InputError for a bad study or directory, FileError, Stopped at SIGINT and SIGTERM, and with a job's message and
/// code where that fails. Whatever is finished then is kept: the same call goes on.
void run_study(const StudyCall& call);

/// Runs one job in this process, unless its file is there. Throws InputError for an unknown id, as the job does, FileError.
void run_job(const StudyCall& call, const std::string& id);

/// Writes tables and charts from what is there. Throws InputError while jobs are missing, FileError.
void collect_study(const StudyCall& call);

}  // namespace grainclock::benchmarks
