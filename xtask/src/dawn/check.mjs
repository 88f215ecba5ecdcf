// Asks Dawn, the WebGPU of Chromium, about the kernels. `node check.mjs WHAT FOLDER`:
// compile  every kernel of kernels.json, in both variants, with Dawn's compiler alone; no driver is needed
// adapter  is there a driver that Dawn takes?
// replay   does what trace.json and trace.bin say, list by list, and writes what the buffers with results hold to replayed.bin

import fs from "node:fs";
import path from "node:path";
import { create, globals } from "webgpu";

Object.assign(globalThis, globals);

// Arguments of a dispatch are immediates, which WebGPU is about to have.
const FEATURES = "enable-dawn-features=allow_unsafe_apis,expose_wgsl_experimental_features";
// What browsers give.
const LIMITS = { maxStorageBuffersPerShaderStage: 10, maxImmediateSize: 16 };

// Dispatches that are handed over at once: the longer a list, the more often lavapipe crashes under Dawn.
const TOGETHER = 50;

const [what, folder] = process.argv.slice(2);
const read = (name) => JSON.parse(fs.readFileSync(path.join(folder, name), "utf8"));

async function open(backend) {
  const gpu = create([`backend=${backend}`, FEATURES]);
  const adapter = await gpu.requestAdapter();
  return { gpu, adapter };
}

async function openDevice(backend, requiredLimits) {
  const { gpu, adapter } = await open(backend);
  if (!adapter) throw new Error(`Dawn finds no adapter (${backend})`);
  const requiredFeatures = ["subgroups"].filter((f) => adapter.features.has(f));
  const device = await adapter.requestDevice({ requiredFeatures, requiredLimits });
  return { gpu, adapter, device };
}

// A kernel's text, with what its variant needs.
const text = ({ code, variant }) => (variant === "subgroup" && code.includes("subgroup") ? `enable subgroups;\n${code}` : code);

async function compile() {
  const { gpu, device } = await openDevice("null", {});
  const refused = [];
  const kernels = read("kernels.json");
  for (const kernel of kernels) {
    const { name, variant } = kernel;
    const code = text(kernel);
    device.pushErrorScope("validation");
    const module = device.createShaderModule({ code });
    const messages = (await module.getCompilationInfo()).messages.filter((m) => m.type === "error");
    const error = await device.popErrorScope();
    if (messages.length > 0 || error) {
      const first = messages[0];
      refused.push(`${name} (${variant}): ${first ? `${first.message.trim()}: ${code.split("\n")[first.lineNum - 1]}` : error.message}`);
    }
  }
  refused.forEach((line) => console.log(`refused: ${line}`));
  console.log(`${kernels.length - refused.length} of ${kernels.length} variants accepted`);
  void gpu;
  return refused.length === 0 ? 0 : 1;
}

async function replay() {
  const { gpu, adapter, device } = await openDevice("vulkan", LIMITS);
  console.log(`Dawn on ${adapter.info.description}`);
  const problems = [];
  device.addEventListener("uncapturederror", (e) => problems.push(e.error.message));
  const trace = read("trace.json");
  const data = fs.readFileSync(path.join(folder, "trace.bin"));
  const usage = GPUBufferUsage.STORAGE | GPUBufferUsage.UNIFORM | GPUBufferUsage.INDIRECT | GPUBufferUsage.COPY_SRC | GPUBufferUsage.COPY_DST;
  const buffers = trace.sizes.map((size) => device.createBuffer({ size, usage }));
  const pipelines = new Map();
  const pipelineOf = (number) => {
    if (!pipelines.has(number)) {
      const { name, bindings, constants } = trace.kernels[number];
      const entries = bindings.map(([, binding, writes, uniform]) => ({
        binding,
        visibility: GPUShaderStage.COMPUTE,
        buffer: { type: uniform ? "uniform" : writes ? "storage" : "read-only-storage" },
      }));
      const layout = device.createBindGroupLayout({ entries });
      const whole = device.createPipelineLayout({ bindGroupLayouts: [layout], immediateSize: 16 });
      const module = device.createShaderModule({ code: text(trace.kernels[number]) });
      const pipeline = device.createComputePipeline({ layout: whole, compute: { module, entryPoint: name, constants } });
      pipelines.set(number, { pipeline, layout, bindings });
    }
    return pipelines.get(number);
  };
  const groups = new Map();
  const groupOf = (number, own) => {
    const key = `${number}: ${own}`;
    if (!groups.has(key)) {
      const { layout, bindings } = pipelineOf(number);
      const entries = bindings.map(([, binding], i) => ({ binding, resource: { buffer: buffers[own[i]] } }));
      groups.set(key, device.createBindGroup({ layout, entries }));
    }
    return groups.get(key);
  };
  let dispatches = 0;
  const out = [];
  for (const submission of trace.submissions) {
    submission.buffers.forEach((buffer, i) => {
      const start = submission.before[i];
      device.queue.writeBuffer(buffers[buffer], 0, data, start, trace.sizes[buffer]);
    });
    let encoder = device.createCommandEncoder();
    let pass = null;
    const close = () => {
      pass?.end();
      pass = null;
    };
    for (const work of submission.work) {
      if (work.clear !== undefined) {
        close();
        encoder.clearBuffer(buffers[work.clear]);
      } else if (work.copy) {
        close();
        const [from, at, to, place, bytes] = work.copy;
        encoder.copyBufferToBuffer(buffers[from], at, buffers[to], place, bytes);
      } else {
        pass ??= encoder.beginComputePass();
        pass.setPipeline(pipelineOf(work.pass).pipeline);
        pass.setBindGroup(0, groupOf(work.pass, work.buffers));
        pass.setImmediates(0, new Uint32Array(work.call));
        if (work.at) pass.dispatchWorkgroupsIndirect(buffers[work.at[0]], work.at[1]);
        else pass.dispatchWorkgroups(...work.groups);
        dispatches += 1;
        if (dispatches % TOGETHER === 0) {
          close();
          device.queue.submit([encoder.finish()]);
          await device.queue.onSubmittedWorkDone();
          encoder = device.createCommandEncoder();
        }
      }
    }
    close();
    // What it is judged by.
    const kept = submission.results.map((buffer) => {
      const size = trace.sizes[buffer];
      const staging = device.createBuffer({ size, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
      encoder.copyBufferToBuffer(buffers[buffer], 0, staging, 0, size);
      return staging;
    });
    device.queue.submit([encoder.finish()]);
    for (const staging of kept) {
      await staging.mapAsync(GPUMapMode.READ);
      out.push(Buffer.from(staging.getMappedRange().slice(0)));
      staging.destroy();
    }
    if (problems.length > 0) throw new Error(problems[0]);
  }
  fs.writeFileSync(path.join(folder, "replayed.bin"), Buffer.concat(out));
  console.log(`${dispatches} dispatches of ${pipelines.size} kernels in ${trace.submissions.length} lists`);
  void gpu;
  return 0;
}

async function main() {
  if (what === "compile") return compile();
  if (what === "replay") return replay();
  const { gpu, adapter } = await open("vulkan");
  console.log(adapter ? adapter.info.description : "none");
  void gpu;
  return adapter ? 0 : 1;
}

main().then(
  // Dawn keeps the process alive otherwise.
  (code) => process.exit(code),
  (error) => {
    console.log(`${error}`);
    process.exit(1);
  },
);
