//! Traces exported nodes with the compute shader of `bvh-core`, and compares every hit with the
//! processor's hit. Needs a Vulkan device; a software device, such as Mesa's lavapipe, will do.
//!
//! `cargo run --release --manifest-path examples/gpu/Cargo.toml`

use bvh_search::bvh_core::export::SHADER;
use bvh_search::prelude::*;
use std::error::Error;
use wgpu::{BindGroupEntry, BufferUsages, PollType, ShaderSource};

/// Creates hills of triangles, and a sheet above one half of them.
fn scene() -> Result<Vec<Triangle>, Box<dyn Error>> {
    let mut positions = Vec::new();
    for i in 0..2 * 81 * 81 {
        let x = (i % 81) as f32;
        let z = (i / 81 % 81) as f32;
        positions.push(if i < 81 * 81 {
            [x, 3.0 * (x * 0.3).sin() * (z * 0.2).cos(), z]
        } else {
            [x * 0.5, 6.0 + 0.1 * z, z]
        });
    }
    // The last row and column of points begin no cell.
    let cells = (0..positions.len() as u32).filter(|i| i % 81 < 80 && i / 81 % 81 < 80);
    let indices: Vec<[u32; 3]> =
        cells.flat_map(|i| [[i, i + 1, i + 81], [i + 82, i + 81, i + 1]]).collect();
    Ok(Triangle::from_mesh(&positions, &indices)?)
}

/// Creates the rays of a picture of 256 × 256 pixels, from a corner above the scene.
fn rays() -> Result<Vec<Ray>, Box<dyn Error>> {
    let mut rays = Vec::new();
    for i in 0..=u16::MAX {
        let x = f32::from(i % 256) / 257.3 - 0.51;
        let y = 0.49 - f32::from(i / 256) / 258.1;
        rays.push(Ray::half_line([-20.0, 30.0, -20.0], [1.0 - x, y - 0.5, 1.0 + x])?);
    }
    Ok(rays)
}

fn create_buffer(device: &wgpu::Device, size: usize, usage: BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: size as u64,
        usage,
        mapped_at_creation: false,
    })
}

/// Returns the hits of `count` rays by the shader, as distances and objects.
fn trace(
    (device, queue): &(wgpu::Device, wgpu::Queue),
    data: [&[u8]; 4],
    count: usize,
) -> Result<Vec<(f32, u32)>, Box<dyn Error>> {
    let source = ShaderSource::Wgsl(SHADER.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    let mut buffers = Vec::new();
    for bytes in data {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let buffer = create_buffer(device, bytes.len(), usage);
        queue.write_buffer(&buffer, 0, bytes);
        buffers.push(buffer);
    }
    // Buffers of shaders cannot be mapped, so a second buffer receives a copy of the hits.
    let hits = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
    buffers.push(create_buffer(device, 8 * count, hits));
    let read = create_buffer(device, 8 * count, BufferUsages::COPY_DST | BufferUsages::MAP_READ);
    let entries: Vec<BindGroupEntry> = (0..)
        .zip(&buffers)
        .map(|(binding, buffer)| BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(count.div_ceil(64) as u32, 1, 1);
    }
    encoder.copy_buffer_to_buffer(&buffers[4], 0, &read, 0, 8 * count as u64);
    queue.submit([encoder.finish()]);
    read.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.expect("a mapped buffer"));
    device.poll(PollType::wait_indefinitely())?;
    let words: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read.slice(..).get_mapped_range()?);
    Ok(words.into_iter().map(|[t, object]| (f32::from_bits(t), object)).collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let Ok(adapter) = pollster::block_on(instance.request_adapter(&Default::default())) else {
        println!("no Vulkan device: nothing was traced");
        return Ok(());
    };
    println!("{}", adapter.get_info().name);
    let device = pollster::block_on(adapter.request_device(&Default::default()))?;
    let triangles = scene()?;
    let rays = rays()?;
    let boxes = boxes(&triangles);
    let tree = bake(&boxes, Duration::from_millis(500))?.tree;
    let expected: Vec<Option<Hit>> =
        rays.iter().map(|ray| nearest_hit(&tree, &triangles, ray)).collect();
    let corners: Vec<f32> =
        triangles.iter().flat_map(|t| t.0).flat_map(|corner| corner.to_array()).collect();
    let mut ray_data: Vec<f32> = Vec::new();
    for ray in &rays {
        ray_data.extend(ray.origin().extend(ray.t_min()).to_array());
        ray_data.extend(ray.direction().extend(ray.t_max()).to_array());
    }

    let nodes = tree.to_first_count();
    let nodes: &[u8] = bytemuck::cast_slice(&nodes);
    let data = [
        nodes,
        bytemuck::cast_slice(&tree.prim_ids),
        bytemuck::cast_slice(&corners),
        bytemuck::cast_slice(&ray_data),
    ];
    let found = trace(&device, data, rays.len())?;
    let mut differences = 0;
    for ((t, object), expected) in found.iter().zip(&expected) {
        // Only distances are compared, because a ray through an edge may hit either triangle.
        let agrees = match expected {
            Some(hit) => (t - hit.t).abs() <= 1e-5 * hit.t,
            None => *object == u32::MAX,
        };
        differences += usize::from(!agrees);
    }
    let hits = expected.iter().flatten().count();
    println!(
        "{} bytes, {hits} of {} rays hit, {differences} answers differ",
        nodes.len(),
        rays.len()
    );
    assert!(hits > rays.len() / 4 && differences < 10, "the picture differs");
    Ok(())
}
