//! One integration binary: everything that needs more than one module, or recorded data.

mod imu_logs;
