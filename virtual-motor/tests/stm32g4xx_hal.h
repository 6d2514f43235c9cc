/* The parts of a vendor's header that the example in docs/virtual-motor.md uses, with the vendor's names and types. */
#include <stdint.h>

typedef struct {
    volatile uint32_t CNT, ARR, CCR1, CCR2, CCR3;
} TIM_TypeDef;
typedef struct {
    TIM_TypeDef *Instance;
} TIM_HandleTypeDef;
typedef struct {
    void *Instance;
} ADC_HandleTypeDef;

#define ADC_INJECTED_RANK_1 9U
#define ADC_INJECTED_RANK_2 15U
#define __HAL_TIM_SET_COMPARE(handle, channel, value) ((handle)->Instance->CCR##channel = (value))

uint32_t HAL_ADCEx_InjectedGetValue(const ADC_HandleTypeDef *adc, uint32_t rank);
void HAL_ADCEx_InjectedConvCpltCallback(ADC_HandleTypeDef *adc);
